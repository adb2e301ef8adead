# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One look for every picture: colours that colour-blind readers tell apart, legible type."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Okabe and Ito's blue, vermilion and bluish green, for the body axes x, y and z.
AXIS_COLOURS = ('#0072B2', '#D55E00', '#009E73')
# And their sky blue, reddish purple and orange, where there is more to tell apart than three axes.
MORE_COLOURS = ('#56B4E9', '#CC79A7', '#E69F00')
AXIS_NAMES = ('x', 'y', 'z')
INK = '#222222'
LIMIT_COLOUR = '#666666'
DOTS_PER_INCH = 150

_STYLE = {
    'font.size': 11.0,
    'axes.labelsize': 11.0,
    'axes.titlesize': 12.0,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'axes.axisbelow': True,
    'grid.color': '#DDDDDD',
    'grid.linewidth': 0.6,
    'axes.edgecolor': INK,
    'axes.labelcolor': INK,
    'text.color': INK,
    'xtick.color': INK,
    'ytick.color': INK,
    'lines.linewidth': 1.8,
    'legend.frameon': False,
    'figure.facecolor': 'white',
}


@contextmanager
def styled() -> Iterator[None]:
    """Apply the look to everything drawn inside, and to nothing else."""
    with mpl.rc_context(_STYLE):
        yield


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a picture and return where it is."""
    figure.savefig(path, dpi=DOTS_PER_INCH)
    return path


def set_colours(number: int) -> list[str]:
    """Return colours for a number of sets; after six they repeat."""
    return list(itertools.islice(itertools.cycle(AXIS_COLOURS + MORE_COLOURS), number))


def draw_limits(axes: Axes, limits: Sequence[float] | np.ndarray | None) -> None:
    """Draw the finite limits, both signs, as dashed lines; one pair when the axes share them."""
    if limits is None:
        return
    values = np.asarray(limits, dtype=float)
    same = bool(np.all(values == values[0]))
    pairs = [(values[0], LIMIT_COLOUR)] if same else list(zip(values, AXIS_COLOURS, strict=True))
    labelled = False
    for value, colour in pairs:
        if not np.isfinite(value):
            continue
        for sign in (-1.0, 1.0):
            axes.axhline(sign * value, color=colour, linestyle='--', linewidth=1.2, zorder=1.5,
                         label=None if labelled else 'limit')
            labelled = True


def legend_right(axes: Axes) -> None:
    """Put the legend beside the panel, where it covers no curve; curves first, then marks."""
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda index: labels[index].startswith('limit'))
    axes.legend([handles[index] for index in order], [labels[index] for index in order],
                loc='center left', bbox_to_anchor=(1.0, 0.5), handlelength=1.6)
