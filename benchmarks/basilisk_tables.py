# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables and pictures of what basilisk/measure.py measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from program_tables import table

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, save_figure, styled

#: What is drawn no smaller [deg].
FLOOR_DEG = 1e-8


def slews(data: dict[str, Any]) -> str:
    """Return when half turns settled, and what became of limits and error."""
    rows = data['slews']
    ideal_s = rows['ideal torque']['settled_s']
    return table(
        ['half turn with', 'settled after [s]', 'of ideal torque', 'largest rate, of the limit',
         'error in the last minute [deg]', 'ticks with a converged plan'],
        [[name, f'{row["settled_s"]:g}', f'{row["settled_s"] / ideal_s:.3f}',
          f'{row["largest_rate_over_limit"]:.4f}', f'{row["steady_error_deg"]:.1e}',
          f'{row["ticks"].get("NOMINAL converged", 0)} of {sum(row["ticks"].values())}']
         for name, row in rows.items()])


def draw_slews(data: dict[str, Any], path: Path) -> Path:
    """Draw errors, rates against the limit, and speeds of the wheels over time."""
    rows = data['slews']
    with styled():
        figure = Figure(figsize=(11.0, 3.6), layout='constrained')
        error, rate, speed = figure.subplots(1, 3)
        for (name, colour), width in zip({
                'ideal torque': '#666666', 'wheels, not estimated': AXIS_COLOURS[0],
                'wheels, estimated, rate limit tightened': AXIS_COLOURS[2]}.items(),
                (3.0, 1.2, 1.2)):
            trace = rows[name]['trace']
            time_s = trace['every_s'] * np.arange(len(trace['error_deg']))
            error.semilogy(time_s, np.maximum(trace['error_deg'], FLOOR_DEG), color=colour,
                           linewidth=width, label=name)
            rate.plot(time_s, trace['rate_over_limit'], color=colour, linewidth=width)
        for index, each in enumerate(trace['wheel_rpm']):
            speed.plot(time_s, each, label=f'wheel {index + 1}')
        error.set(title='Attitude error [deg]', xlabel='time [s]', ylim=(1e-12, 1e3))
        rate.set(title='Largest rate about a body axis, of the limit', xlabel='time [s]',
                 xlim=(0.0, 170.0), ylim=(0.9, 1.05))
        rate.axhline(1.0, color='#666666', linewidth=0.8, linestyle=':')
        speed.set(title='Wheel speeds [rpm]', xlabel='time [s]')
        speed.axhline(0.0, color='#666666', linewidth=0.8, linestyle=':')
        error.legend(loc='lower left', fontsize='small')
        speed.legend(loc='lower right', fontsize='small')
        return save_figure(figure, path)
