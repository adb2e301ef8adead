# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of one quantity in two runs, solid and dotted as in the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, INK, save_figure, styled

# One look for each run: colour, line, marker.
_LOOKS = ((AXIS_COLOURS[0], '-', 'o'), (AXIS_COLOURS[1], ':', 's'))


@dataclass(frozen=True, eq=False)
class Curve:
    """One run: its name and its values (n,)."""

    label: str
    values: np.ndarray


def plot_pair(
    curves: Sequence[Curve], time_s: np.ndarray, quantity: str, held: bool, path: Path,
) -> Path:
    """Draw two runs over time (n,) [s]; ``held`` values are steps, each kept until the next."""
    with styled():
        figure = Figure(figsize=(7.5, 4.2), layout='constrained')
        axes = figure.subplots()
        axes.axhline(0.0, color=INK, linewidth=0.8)
        for curve, (colour, line, marker) in zip(curves, _LOOKS, strict=True):
            axes.plot(time_s, curve.values, color=colour, linestyle=line, linewidth=2.2,
                      marker=marker, markersize=4.0, label=curve.label, clip_on=False,
                      drawstyle='steps-post' if held else 'default')
        axes.set_xlim(0.0, float(time_s[-1]))
        axes.margins(y=0.08)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
        axes.set_xlabel('time [s]')
        axes.set_ylabel(quantity)
        axes.legend(title='initial rotation', loc='best')
        return save_figure(figure, path)
