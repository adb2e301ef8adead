# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments that several verbs share, their validators, and the shipped parameter files."""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Callable
from pathlib import Path

import manifold_mpc_ros
from manifold_mpc_ros.config.tables import SIMULATOR_NAME
from manifold_mpc_ros.config.yaml_file import sections_of
from manifold_mpc_ros.errors import ConfigurationError

PACKAGE = 'manifold_mpc_ros'


def positive_number(text: str) -> float:
    """Read a finite number above zero."""
    value = number(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number above 0')
    return value


def number(text: str) -> float:
    """Read a finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'{text!r} is not a finite number')
    return value


def whole_number(least: int, most: int = 10**6) -> Callable[[str], int]:
    """Return a reader of whole numbers from ``least`` to ``most``."""
    def read(text: str) -> int:
        if not (text.isdecimal() and len(text) < 20 and least <= int(text) <= most):
            raise argparse.ArgumentTypeError(
                f'{text!r} is not a whole number from {least} to {most}')
        return int(text)
    return read


def add_workers(parser: argparse._ActionsContainer) -> None:
    """Add ``--workers``."""
    parser.add_argument(
        '--workers', type=whole_number(1, 1024), default=os.cpu_count() or 1, metavar='N',
        help='processes that share the work (default: one for each core, here %(default)s)')


def add_controller_config(parser: argparse.ArgumentParser) -> None:
    """Add ``--controller-config``."""
    parser.add_argument(
        '--controller-config', type=Path, metavar='FILE',
        help='parameter file of the controller (default: the shipped controller.yaml)')


def add_simulator_config(parser: argparse.ArgumentParser) -> None:
    """Add ``--simulator-config``."""
    parser.add_argument(
        '--simulator-config', type=Path, metavar='FILE',
        help="parameter file of the simulator (default: the controller's, where that has a "
             'section lgvi_simulator, else the shipped simulator.yaml)')


def add_tolerances(parser: argparse.ArgumentParser) -> None:
    """Add the two bounds that say what settled means."""
    parser.add_argument(
        '--attitude-tolerance', type=positive_number, default=0.1, metavar='DEG',
        help='settled below this attitude error in degrees (default: %(default)s)')
    parser.add_argument(
        '--rate-tolerance', type=positive_number, metavar='RAD/S',
        help='settled below this body rate in rad/s (default: 0.001, and no more than full '
             'torque stops within half the attitude tolerance)')


def add_output(parser: argparse.ArgumentParser, default: str) -> None:
    """Add ``--output``."""
    parser.add_argument(
        '--output', type=Path, default=Path(default), metavar='DIR',
        help='folder for pictures and data, made when it is not there (default: %(default)s)')


def add_backend(parser: argparse.ArgumentParser, default: str) -> None:
    """Add ``--backend``; the value is None when it is not given."""
    parser.add_argument(
        '--backend', choices=('auto', 'c'),
        help=f'run the solver as generated C, which auto means too; default: {default}')


def controller_config_path(given: Path | None) -> Path:
    """Return the controller's parameter file: the given one or the shipped one."""
    return given or shipped_config('controller.yaml')


def config_paths(arguments: argparse.Namespace) -> tuple[Path, Path]:
    """Return the parameter files of controller and simulator: those given or the shipped ones.

    A file of the controller with a section for the simulator is that of both.
    """
    controller = controller_config_path(arguments.controller_config)
    if arguments.simulator_config is not None:
        return controller, arguments.simulator_config
    both = any(section.split('/')[-1] == SIMULATOR_NAME for section in sections_of(controller))
    return controller, controller if both else shipped_config('simulator.yaml')


def shipped_config(name: str) -> Path:
    """Return a parameter file that came with the package.

    The source tree first (an editable install, a symlink install, a checkout), then the share
    folder of the prefix that the package is installed in, then those of ``AMENT_PREFIX_PATH``.

    Raises ConfigurationError when none of them has it.
    """
    package = Path(manifold_mpc_ros.__path__[0]).resolve()
    prefixes = [*package.parents]
    prefixes += map(Path, filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)))
    places = [package.parent] + [prefix / 'share' / PACKAGE for prefix in prefixes]
    for place in places:
        candidate = place / 'config' / name
        if candidate.is_file():
            return candidate
    raise ConfigurationError(
        'parameter file', name, f'to be in share/{PACKAGE}/config of the install prefix; '
        'name your own file with --controller-config and --simulator-config')
