# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the verbs print and write: tables on the terminal, columns in CSV files."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

# Tables keep this width where the output is no terminal.
PLAIN_WIDTH = 100


def make_console(stderr: bool = False) -> Console:
    """Return a console that does without colours and cursor control where there is no terminal."""
    from rich.console import Console
    console = Console(highlight=False, stderr=stderr)
    return console if console.is_terminal else Console(
        highlight=False, stderr=stderr, width=PLAIN_WIDTH)


def result_table(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """Return a table of named results."""
    from rich.table import Table
    from rich.text import Text
    table = Table(title=title, title_justify='left', show_header=False)
    table.add_column(style='bold')
    table.add_column()
    for name, value in rows:
        table.add_row(name, Text(value))
    return table


def grid_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return a table with a header, numbers aligned to the right."""
    from rich.table import Table
    from rich.text import Text
    table = Table(title=title, title_justify='left')
    for index, name in enumerate(header):
        table.add_column(Text(name), justify='left' if index == 0 else 'right')
    for row in rows:
        table.add_row(*map(Text, row))
    return table


def say_written(console: Console, paths: Iterable[Path]) -> None:
    """Print where files are, one a line, never broken."""
    console.print('Written:')
    for path in paths:
        console.print(f'  {path}', soft_wrap=True, markup=False)


def vector_text(values: Iterable[float], unit: str = '') -> str:
    """Return numbers as ``(x, y, z) unit``, with 4 digits; 0 for rounding beside the largest."""
    values = list(values)
    rounding = 1e-12 * max(filter(math.isfinite, map(abs, values)), default=0.0)
    text = ', '.join(f'{0.0 if abs(value) < rounding else value:.4g}' for value in values)
    return f'({text}) {unit}'.rstrip()


def limit_text(limit: np.ndarray | None) -> str:
    """Return the limits as text for a result row."""
    return 'no limit' if limit is None else f'limit {vector_text(limit)}'


def settled_text(settled_s: float | None, attitude_deg: float, rate_rad_s: float) -> str:
    """Say when the error settled below its two bounds."""
    bounds = f'below {attitude_deg:g} deg and {rate_rad_s:g} rad/s'
    return f'NOT settled {bounds}' if settled_s is None else f'{settled_s:.2f} s ({bounds})'


def counts_text(values: Iterable[object]) -> str:
    """Return each distinct value with how often it occurs, the most frequent first."""
    return ', '.join(f'{value} {count}' for value, count in Counter(
        map(str, values)).most_common())


def write_csv(path: Path, columns: Mapping[str, np.ndarray | Sequence[object]]) -> Path:
    """Write columns of equal length, numbers with all their digits; return where."""
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*map(_plain, columns.values()), strict=True))
    return path


def axis_columns(name: str, unit: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Return vectors (n, 3) as three named columns."""
    return {f'{name}_{axis}_{unit}': values[:, index] for index, axis in enumerate('xyz')}


def attitude_columns(R_NB: np.ndarray) -> dict[str, np.ndarray]:
    """Return rotations (n, 3, 3) as nine columns, row by row."""
    return {f'R_NB_{row + 1}{column + 1}': R_NB[:, row, column]
            for row in range(3) for column in range(3)}


def _plain(column: np.ndarray | Sequence[object]) -> Sequence[object]:
    """Return Python values, which the csv module writes without loss."""
    return column.tolist() if isinstance(column, np.ndarray) else column
