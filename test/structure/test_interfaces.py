# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Executables and their topics: ``PROGRAM`` of each main module; setup.py and the page agree.

The policies of config/sros2 and the help are made from it.
"""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

from manifold_mpc_ros.cli.main import PROGRAM as COMMAND
from manifold_mpc_ros.nodes.usage import Program

TOP = Path(__file__).parents[2]

def entry_points() -> dict[str, str]:
    """Return the executables of setup.py, each with its module."""
    tree = ast.parse((TOP / 'setup.py').read_text(encoding='utf-8'))
    value = next(node.value for node in tree.body if isinstance(node, ast.Assign)
                 and ast.unparse(node.targets[0]) == 'EXECUTABLES')
    table = eval(ast.unparse(value), {'NAME': 'manifold_mpc_ros'})  # noqa: S307
    return {name: main.partition(':')[0] for name, main in table.items()}


PROGRAMS: list[Program] = [importlib.import_module(module).PROGRAM
                           for name, module in entry_points().items() if name != COMMAND]


def rows(page: str, heading: str) -> list[list[str]]:
    """Return the cells of the first table below a heading of a page, without its head."""
    text = (TOP / page).read_text(encoding='utf-8').partition(heading)[2]
    lines = re.search(r'^\|.*?(?=\n\n)', text, re.MULTILINE | re.DOTALL)
    assert lines is not None
    return [[cell.strip().strip('`') for cell in line.strip('|').split(' | ')]
            for line in lines.group().splitlines()[2:]]


def test_every_program_is_an_entry_point_of_its_name() -> None:
    found = {path.parent.name for path in (TOP / 'manifold_mpc_ros/nodes').glob('*/main.py')}
    assert found == {program.executable for program in PROGRAMS} == set(entry_points()) - {COMMAND}


def test_the_page_lists_every_executable() -> None:
    listed = {(cells[0], cells[1]) for cells in rows('docs/nodes.md', '# The nodes')}
    assert listed == {(program.executable, program.node_name) for program in PROGRAMS}


def test_the_page_lists_every_topic_and_service_with_its_type() -> None:
    listed = {(cells[0], cells[1]) for cells in rows('docs/nodes.md', '## Topics and services')}
    own = {(name.replace('~/prediction', 'attitude_controller/prediction').replace(
        '~/disturbance', 'attitude_controller/disturbance').replace(
        'attitude_controller/description', '~/description'),
            re.sub('/(msg|srv)/', '/', kind))
           for program in PROGRAMS for name, kind, _ in (
               *program.subscribes, *program.publishes, *program.replies)}
    assert listed == own
