# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Executables and their topics: ``PROGRAM`` of each main module; every other list agrees with it.

The policies in config/sros2 are compared with the running nodes in test/nodes.
"""

from __future__ import annotations

import ast
import importlib
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from manifold_mpc_ros.cli.main import PROGRAM as COMMAND
from manifold_mpc_ros.nodes.usage import Program

TOP = Path(__file__).parents[2]
# What every node, or every lifecycle node, has without saying so.
OF_EVERY_NODE = {
    'parameter_events', 'rosout', '~/transition_event', '~/change_state', '~/get_state',
    '~/get_available_states', '~/get_available_transitions', '~/get_transition_graph',
    '~/describe_parameters', '~/get_parameter_types', '~/get_parameters', '~/list_parameters',
    '~/set_parameters', '~/set_parameters_atomically', '~/get_type_description',
}


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
    own = {(name.replace('~/prediction', 'attitude_controller/prediction'),
            re.sub('/(msg|srv)/', '/', kind))
           for program in PROGRAMS for name, kind, _ in program.interfaces}
    assert listed == own


@pytest.mark.parametrize('program', PROGRAMS, ids=lambda program: program.executable)
def test_the_policy_allows_what_the_help_lists(program: Program) -> None:
    path = TOP / f'config/sros2/{program.node_name}.xml'
    if not path.exists():
        assert program.executable == 'markers'  # no part of the loop
        return
    allowed = {item.text for group in ET.parse(path).getroot().iter('profile')
               for kind in group for item in kind}
    assert {name.removeprefix('/') for name, _, _ in program.interfaces} == (
        allowed - OF_EVERY_NODE)
