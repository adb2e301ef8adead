# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``export``: the whole controller of a parameter file as plain C99."""

from __future__ import annotations

import argparse
from pathlib import Path

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig

EXAMPLES = """\
  manifold-mpc export --params mine.yaml --output flight
      manifold_mpc.h, .c, _data.h, example.c, Makefile, CMakeLists.txt, README.md in flight/
  make -C flight && flight/example
      build it, and close a loop on its own predictions
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument('--params', type=Path, required=True, metavar='FILE',
                        help='parameter file of the controller')
    parser.add_argument('--output', type=Path, required=True, metavar='DIR',
                        help='folder for the C files, made when it is not there')
    parser.add_argument('--moving', action='store_true',
                        help='with references: targets that move over the horizon')


def run(arguments: argparse.Namespace) -> int:
    """Design, generate, write."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.export.sources import exported
    from manifold_mpc_ros.mpc.stored_design import stored_design
    config = AttitudeMpcConfig.from_yaml(arguments.params)
    console = report.make_console()
    with console.status('Designing the terminal set, generating the code'):
        files = exported(config, stored_design(config, None), moving=arguments.moving)
    arguments.output.mkdir(parents=True, exist_ok=True)
    written = []
    for name, text in files.items():
        path = arguments.output / name
        path.write_text(text, encoding='utf-8')
        written.append(path)
    report.say_written(console, written)
    return 0
