# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of a comparison: time over the horizon, cold and warm, one line a solver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, INK, LIMIT_COLOUR, save_figure, styled
from manifold_mpc_ros.lab.benchmark.peers import solver

_BLUE, _RED, _GREEN = AXIS_COLOURS
_ORANGE, _PURPLE, _SKY = '#E69F00', '#CC79A7', '#56B4E9'
_LOOKS: dict[str, dict[str, Any]] = {
    solver.OUR_LOCAL.name: {'color': _BLUE, 'linewidth': 3.0, 'marker': 'o'},
    solver.OUR_SEARCH.name: {'color': _BLUE, 'linewidth': 3.0, 'marker': 's', 'linestyle': '--'},
    solver.ACADOS_SQP.name: {'color': _RED, 'marker': '^'},
    solver.ACADOS_DAQP.name: {'color': _RED, 'marker': 'v', 'linestyle': '--'},
    solver.ACADOS_RTI.name: {'color': _RED, 'marker': '.', 'linestyle': ':'},
    solver.FATROP.name: {'color': _GREEN, 'marker': 'D'},
    solver.IPOPT.name: {'color': _ORANGE, 'marker': 'P'},
    solver.SQP_QRQP.name: {'color': _PURPLE, 'marker': 'X'},
    solver.SQP_HPIPM.name: {'color': _PURPLE, 'marker': 'x', 'linestyle': '--'},
    solver.FATROP_VM.name: {'color': _GREEN, 'marker': 'D', 'linestyle': ':'},
    solver.IPOPT_VM.name: {'color': _ORANGE, 'marker': 'P', 'linestyle': ':'},
}


def plot_bench(data: Mapping[str, Any], path: Path) -> Path:
    """Draw median times, with the 99th percentile as a thin mark above, into a PNG."""
    with styled():
        figure = Figure(figsize=(12.0, 6.5), layout='constrained')
        cold, warm = figure.subplots(1, 2, sharey=True)
        for axes, start, title in (
                (cold, 'cold', 'Cold: one solve from a slew'),
                (warm, 'warm', 'Warm: closed loops, from the shifted plan')):
            _draw(axes, [row for row in data['rows'] if row['start'] == start])
            axes.set_title(title)
            axes.set_xlabel('horizon N')
        _draw_bound(cold, data['limit'])
        cold.set_ylabel("solver's own time, median [us]; thin mark: 99 %")
        entries = dict(zip(*reversed(cold.get_legend_handles_labels())))
        entries |= dict(zip(*reversed(warm.get_legend_handles_labels())))
        figure.legend(entries.values(), entries.keys(), loc='outside right center')
        return save_figure(figure, path)


def _draw(axes: Axes, rows: Sequence[Mapping[str, Any]]) -> None:
    """Draw all solvers of one way of starting."""
    axes.set_xscale('log', base=2)
    axes.set_yscale('log')
    for name in dict.fromkeys(row['solver'] for row in rows):
        own = sorted((row for row in rows if row['solver'] == name),
                     key=lambda row: row['horizon'])
        horizons = [row['horizon'] for row in own]
        look = _LOOKS.get(name, {'color': INK})
        axes.plot(horizons, [row['solver_us_median'] for row in own], label=name, **look)
        axes.plot(horizons, [row['solver_us_p99'] for row in own], linestyle='none', marker='_',
                  color=look['color'], alpha=0.6)
    horizons = sorted({row['horizon'] for row in rows})
    axes.set_xticks(horizons, [str(n) for n in horizons])
    axes.minorticks_off()


def _draw_bound(axes: Axes, limits: Sequence[Mapping[str, Any]]) -> None:
    """Draw the least time of a single pass on this core."""
    if limits:
        axes.plot([each['horizon'] for each in limits], [each['bound_us'] for each in limits],
                  color=LIMIT_COLOUR, linestyle='--', linewidth=1.2,
                  label="one pass at the core's rate")
