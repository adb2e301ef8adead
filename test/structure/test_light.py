# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is loaded, and when: nothing heavy by an import of the package or by ``--help``."""

from __future__ import annotations

import ast

import pytest
from test_imports import (
    MODULES,
    PACKAGE,
    TOP,
    imported_names,
    module_of,
    package_imports,
)
from test_without_ros import run

import manifold_mpc_ros
from manifold_mpc_ros.cli.extras import EXTRAS
from manifold_mpc_ros.cli.verbs import VERBS

HEAVY = {'casadi', 'numpy', 'scipy', 'yaml', 'rclpy', *EXTRAS}
HELP = """
import sys
from manifold_mpc_ros.cli.main import main
try:
    main({arguments!r})
except SystemExit:
    print('loaded:', *sys.modules)
"""


def loaded_by(program: str) -> set[str]:
    """Return the modules that a program, which prints them last, has loaded."""
    return set(run(program))


def verb_module(verb: str) -> str:
    """Return the full name of a verb's module."""
    return f'{PACKAGE}.lab.{VERBS[verb].module}'


def test_the_package_alone_loads_nothing() -> None:
    loaded = loaded_by(f'import sys, {PACKAGE}\nprint(*sys.modules)')
    assert {name for name in loaded if name.startswith(PACKAGE)} == {PACKAGE}
    assert not HEAVY & loaded


def test_help_loads_no_verb() -> None:
    loaded = loaded_by(HELP.format(arguments=['--help']))
    assert f'{PACKAGE}.cli.main' in loaded
    assert not HEAVY & loaded
    assert not {name for name in loaded if name.startswith(f'{PACKAGE}.lab')}


def test_help_of_a_verb_loads_that_verb() -> None:
    loaded = loaded_by(HELP.format(arguments=['check', '--help']))
    assert {verb for verb in VERBS if verb_module(verb) in loaded} == {'check'}
    assert not set(EXTRAS) & loaded


def test_no_verb_imports_another() -> None:
    for verb in VERBS:
        path = TOP / f'{verb_module(verb).replace(".", "/")}.py'
        top_level = ast.Module([node for node in ast.parse(path.read_text(encoding='utf-8')).body
                                if isinstance(node, ast.ImportFrom)], [])
        names = {name.rpartition('.')[0]
                 for _, name in imported_names(top_level, verb_module(verb), False)}
        assert not names & {verb_module(other) for other in VERBS}, verb


def test_public_names_are_those_that_type_checkers_see() -> None:
    tree = ast.parse((TOP / PACKAGE / '__init__.py').read_text(encoding='utf-8'))
    typed = {name.rpartition('.')[2]: name.rpartition('.')[0]
             for _, name in imported_names(tree, PACKAGE, True) if name.startswith(PACKAGE)}
    lazy = {name: f'{PACKAGE}.{module}' for name, module in manifold_mpc_ros._MODULES.items()}
    assert typed == lazy
    assert set(lazy) == set(manifold_mpc_ros.__all__) <= set(dir(manifold_mpc_ros))
    for name, module in lazy.items():
        assert getattr(manifold_mpc_ros, name).__module__ == module
    with pytest.raises(AttributeError, match='no_such_name'):
        _ = manifold_mpc_ros.no_such_name


def test_the_table_has_the_packages_that_each_verb_may_import() -> None:
    """All that is reached from its module, lazily or not, in the extra ``lab``."""
    graph = package_imports()
    foreign: dict[str, set[str]] = {}
    for path in MODULES:
        module, is_package = module_of(path.relative_to(TOP / PACKAGE).as_posix())
        tree = ast.parse(path.read_text(encoding='utf-8'))
        foreign[module] = {name.partition('.')[0]
                           for _, name in imported_names(tree, module, is_package)}
    for verb in VERBS:
        reached: set[str] = set()
        waiting = [verb_module(verb)]
        while waiting:
            module = waiting.pop()
            waiting += graph[module] - reached
            reached.add(module)
        needed = set().union(*(foreign[module] for module in reached))
        of_lab = {name for name in needed if EXTRAS.get(name) == 'lab'}
        assert of_lab == set(VERBS[verb].packages), verb
