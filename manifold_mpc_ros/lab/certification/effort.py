# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How much work a proof may be, and how far it is: shared by ``certify`` and ``verify``."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from manifold_mpc_ros.cli import arguments as shared

if TYPE_CHECKING:
    from rich.console import Console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say how much work may be done."""
    shared.add_workers(parser)
    parser.add_argument(
        '--budget', type=shared.whole_number(1, 10**9), default=200_000, metavar='BOXES',
        help='boxes after which a level counts as not provable (default: %(default)s)')


@contextmanager
def shown(console: Console, doing: str) -> Iterator[Callable[[float, int], None]]:
    """Show the part of the volume that is proved; yields the callback, (part, boxes)."""
    from manifold_mpc_ros.cli.progress import Progress
    with Progress(console, '% of the volume', 100.0, doing) as progress:
        yield lambda part, boxes: progress.show(round(100.0 * part), f'{boxes} boxes')
