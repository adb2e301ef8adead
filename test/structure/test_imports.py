# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The dependency direction of the modules, read from their import statements.

What flies: ``errors < lie < config < dynamics < terminal < mpc < control < sim < nodes``; a module
imports its own layer and those below it. The laboratory (``lab``) and the command line (``cli``)
import what flies, and nothing that flies imports them. There is no circle, lazy and typing-only
imports included.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
PACKAGE = 'manifold_mpc_ros'
MODULES = sorted((TOP / PACKAGE).rglob('*.py'))
MOST_MODULES = 20

FLIES = ('errors', 'lie', 'config', 'dynamics', 'terminal', 'mpc', 'control', 'sim', 'nodes')
LAYERS = (*FLIES, 'cli', 'lab')
MAY_IMPORT = {layer: set(LAYERS[:rank + 1]) for rank, layer in enumerate(LAYERS)}
# The package's own __init__ has the public names, which programs and the command line may use.
MAY_IMPORT[''] = {'errors', 'config', 'dynamics', 'terminal', 'mpc', 'lab'}
MAY_IMPORT['cli'] -= {'nodes'}
MAY_IMPORT['cli'].add('')
MAY_IMPORT['lab'].add('')

# External packages, and the only places that may import them.
ROS = {
    'action_msgs', 'ament_index_python', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs',
    'launch', 'launch_ros', 'lifecycle_msgs', 'nav_msgs', 'rcl_interfaces', 'rclpy',
    'rosgraph_msgs', 'rosidl_runtime_py', 'sensor_msgs', 'std_msgs', 'std_srvs', 'tf2_ros',
    'trajectory_msgs', 'visualization_msgs',
}
ROS_PLACES = ('nodes/', 'lab/recording/nodes/', 'lab/fault_injection/nodes/',
              'lab/benchmark/latency_probe.py')
ONLY_IN: dict[str, tuple[str, ...]] = dict.fromkeys(ROS, ROS_PLACES)
ONLY_IN |= dict.fromkeys(('matplotlib', 'mpl_toolkits', 'plotly', 'rich'), ('cli/', 'lab/'))
ONLY_IN |= dict.fromkeys(('dask', 'distributed', 'pyarrow'), ('lab/campaign/',))
ONLY_IN['rosbags'] = ('lab/recording/bags/',)
# No clock below the nodes, except that the solver reports its time and ends early on a budget.
ONLY_IN |= dict.fromkeys(('datetime', 'sched', 'time'), ('nodes/', 'cli/', 'lab/', *(
    f'mpc/{path}.py' for path in ('attitude_mpc',))))


def layer_of(module: str) -> str:
    """Return the layer of ``manifold_mpc_ros.<layer>...``, empty for the package itself."""
    first = [*module.split('.'), ''][1]
    return first if first in MAY_IMPORT else ''


def imported_names(tree: ast.AST, module: str, is_package: bool) -> Iterator[tuple[int, str]]:
    """Yield (line, absolute dotted name) for each import, wherever in the file it stands."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ''
            if node.level:
                parents = module.split('.')
                kept = parents[:len(parents) - node.level + is_package]
                base = '.'.join([*kept, base] if base else kept)
            yield from ((node.lineno, f'{base}.{alias.name}') for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(
                ('import_module', '__import__')):
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield node.lineno, argument.value


def module_of(path: str) -> tuple[str, bool]:
    """Map a path below the package to the dotted name, and whether it is a package."""
    parts = Path(path).with_suffix('').parts
    is_package = parts[-1] == '__init__'
    return '.'.join((PACKAGE, *(parts[:-1] if is_package else parts))), is_package


def violations(path: str, source: str) -> list[str]:
    """Return one line for each import of ``manifold_mpc_ros/<path>`` that breaks a rule."""
    module, is_package = module_of(path)
    layer, found = layer_of(module), []
    for line, name in imported_names(ast.parse(source), module, is_package):
        outer = name.partition('.')[0]
        allowed = (layer_of(name) in MAY_IMPORT[layer] if outer == PACKAGE
                   else path.startswith(ONLY_IN.get(outer, ('',))))
        if not allowed:
            found.append(f'{path}:{line}: {layer or "the package"} may not import {name}')
    return found


def package_imports() -> dict[str, set[str]]:
    """Return, for each module, the modules of the package that it imports anywhere."""
    sources = {p.relative_to(TOP / PACKAGE).as_posix(): p.read_text(encoding='utf-8')
               for p in MODULES}
    modules = {module_of(path)[0] for path in sources}
    graph = {}
    for path, source in sources.items():
        module, is_package = module_of(path)
        names = {name for _, name in imported_names(ast.parse(source), module, is_package)}
        graph[module] = {name if name in modules else name.rpartition('.')[0]
                         for name in names if name.startswith(PACKAGE)} - {module}
    return graph


def circle_in(graph: dict[str, set[str]]) -> list[str]:
    """Return the modules of a circle, none when there is no circle."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_every_module_is_in_a_layer() -> None:
    inside = [p.relative_to(TOP / PACKAGE).with_suffix('').parts[0] for p in MODULES]
    assert {layer_of(f'{PACKAGE}.{first}') for first in inside} == set(MAY_IMPORT)
    assert [first for first in inside if not layer_of(f'{PACKAGE}.{first}')] == ['__init__']


def test_imports_point_down() -> None:
    found = [line for p in MODULES for line in violations(
        p.relative_to(TOP / PACKAGE).as_posix(), p.read_text(encoding='utf-8'))]
    assert found == []


def test_what_flies_imports_nothing_of_the_laboratory() -> None:
    """The rule read from the whole graph: nothing of it is reached from what flies."""
    graph = package_imports()
    reached, waiting = set(), [m for m in graph if layer_of(m) in FLIES]
    while waiting:
        module = waiting.pop()
        waiting += graph.get(module, set()) - reached
        reached.add(module)
    assert len(reached) > 50
    assert [m for m in reached if layer_of(m) in ('lab', 'cli')] == []


def test_there_is_no_circle() -> None:
    assert circle_in(package_imports()) == []


def test_a_circle_is_found() -> None:
    assert circle_in({'a': {'b'}, 'b': {'c'}, 'c': {'a'}})


def test_no_folder_is_crowded() -> None:
    counts: dict[str, int] = {}
    for path in MODULES:
        folder = path.parent.relative_to(TOP).as_posix()
        counts[folder] = counts.get(folder, 0) + (path.name != '__init__.py')
    assert {folder: count for folder, count in counts.items() if count > MOST_MODULES} == {}


@pytest.mark.parametrize(('path', 'source'), [
    ('lie/so3.py', 'from manifold_mpc_ros.dynamics import lgvi'),
    ('lie/so3.py', 'from manifold_mpc_ros.config.control_law import AttitudeMpcConfig'),
    ('lie/so3.py', 'from .. import mpc'),
    ('lie/__init__.py', 'from ..sim import plant'),
    ('errors.py', 'import manifold_mpc_ros.lie.so3'),
    ('config/checks.py', 'from manifold_mpc_ros.dynamics.lgvi import cayley_step'),
    ('dynamics/lgvi.py', 'from ..mpc.attitude_mpc import AttitudeMpc'),
    ('dynamics/symbolic.py', 'from manifold_mpc_ros.terminal.manifold import Sphere'),
    ('terminal/design.py', 'from manifold_mpc_ros.mpc.scaling import Array'),
    ('mpc/scaling.py', 'def f():\n    from manifold_mpc_ros.sim.plant import Plant'),
    ('mpc/search.py', 'from manifold_mpc_ros import AttitudeMpc'),
    ('mpc/stored_design.py', 'from manifold_mpc_ros.lab.domain import domain'),
    ('control/modes.py', 'from manifold_mpc_ros.nodes.messages import quaternion_of'),
    ('control/modes.py', 'import rclpy'),
    ('sim/plant.py', 'from manifold_mpc_ros.nodes import simulator'),
    ('nodes/controller/main.py', 'from manifold_mpc_ros.cli import main'),
    ('nodes/process.py', 'from manifold_mpc_ros.lab.recording.nodes import raw'),
    ('__init__.py', 'from manifold_mpc_ros.nodes.controller import main'),
    ('sim/plant.py', 'import rclpy.node'),
    ('lab/recording/verb_record.py', 'from rosbags.rosbag2 import Reader'),
    ('lab/domain/verb.py', 'from distributed import Client'),
    ('lab/demo/verb.py', 'from nav_msgs.msg import Odometry'),
    ('mpc/attitude_mpc.py', 'importlib.import_module("rclpy")'),
    ('sim/plant.py', 'import matplotlib.pyplot as plt'),
    ('nodes/controller/main.py', 'from rich.table import Table'),
    ('sim/plant.py', 'import time'),
    ('control/solver_thread.py', 'from time import perf_counter'),
])
def test_a_wrong_import_is_found(path: str, source: str) -> None:
    assert len(violations(path, source)) == 1


@pytest.mark.parametrize(('path', 'source'), [
    ('lie/so3.py', 'from ..errors import ManifoldMpcError\nimport numpy as np'),
    ('lie/so3.py', 'from . import symbolic'),
    ('terminal/manifold.py', 'from manifold_mpc_ros.lie.symbolic import quaternion_log'),
    ('terminal/problem_of.py', 'from manifold_mpc_ros.dynamics.symbolic import cayley_step'),
    ('mpc/attitude_mpc.py', 'import time'),
    ('config/control_law.py', 'from manifold_mpc_ros.config.checks import finite'),
    ('nodes/controller/node.py', 'import rclpy, time'),
    ('lab/demo/verb.py', 'import rich\nfrom manifold_mpc_ros.nodes.usage import Program'),
    ('__init__.py', 'from .mpc.attitude_mpc import AttitudeMpc'),
])
def test_a_right_import_passes(path: str, source: str) -> None:
    assert violations(path, source) == []
