# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The dependency direction of the modules, read from their import statements.

``cli > bench > nodes > chaos > bags > campaigns > scenarios > sim > safety > mpc > problems >
{theory, dynamics} > lie > errors``: a module imports its own layer and those below it. ``theory``
and ``dynamics`` do not know each other. ``config`` may import ``errors`` and ``lie``; ``dynamics``
and the layers from ``problems`` up may import ``config``; ``nodes`` and ``cli`` may use the
package's public names.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
PACKAGE = 'manifold_mpc_ros'
MODULES = sorted((TOP / PACKAGE).rglob('*.py'))

LAYERS = ('errors', 'lie', 'theory', 'dynamics', 'problems', 'mpc', 'safety', 'sim', 'scenarios',
          'campaigns', 'bags', 'chaos', 'nodes', 'bench', 'cli')
MAY_IMPORT = {
    layer: set(LAYERS[:rank + 1]) | ({'config'} if rank >= LAYERS.index('dynamics') else set())
    for rank, layer in enumerate(LAYERS)
}
MAY_IMPORT['dynamics'].remove('theory')
MAY_IMPORT['config'] = {'config', 'errors', 'lie'}
# The package's own __init__.
MAY_IMPORT[''] = {*LAYERS, 'config'} - {'campaigns', 'bags', 'chaos', 'nodes', 'bench', 'cli'}
MAY_IMPORT['nodes'].add('')
MAY_IMPORT['cli'].add('')

# External packages, and the only layers that may import them.
ROS = {
    'action_msgs', 'ament_index_python', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs',
    'launch', 'launch_ros', 'lifecycle_msgs', 'nav_msgs', 'rcl_interfaces', 'rclpy',
    'rosgraph_msgs', 'rosidl_runtime_py', 'sensor_msgs', 'std_msgs', 'std_srvs', 'tf2_ros',
    'visualization_msgs',
}
ONLY_IN = {name: {'nodes'} for name in ROS}
ONLY_IN.update({name: {'cli'} for name in ('matplotlib', 'mpl_toolkits', 'plotly', 'rich')})
ONLY_IN['rosbags'] = {'bags'}
ONLY_IN.update({name: {'campaigns'} for name in ('dask', 'distributed', 'pyarrow')})
ONLY_IN.update({name: {'nodes', 'bench', 'cli'} for name in ('datetime', 'sched', 'time')})
# The solver reports how long it took, and ends early where it is given a budget of time.
CLOCK_ALLOWED = {(f'mpc/{path}.py', 'time') for path in (
    'attitude_mpc', 'search', 'kernel/interpreted')}


def layer_of(module: str) -> str:
    """Return the layer of ``manifold_mpc_ros.<layer>...``, empty for the package itself."""
    first = [*module.split('.'), ''][1]
    return 'config' if first.startswith('config_') else first if first in MAY_IMPORT else ''


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


def violations(path: str, source: str) -> list[str]:
    """Return one line for each import of ``manifold_mpc_ros/<path>`` that breaks a rule."""
    parts = Path(path).with_suffix('').parts
    is_package = parts[-1] == '__init__'
    module = '.'.join((PACKAGE, *(parts[:-1] if is_package else parts)))
    layer, found = layer_of(module), []
    for line, name in imported_names(ast.parse(source), module, is_package):
        outer = name.partition('.')[0]
        if outer == PACKAGE:
            allowed = layer_of(name) in MAY_IMPORT[layer]
        else:
            allowed = layer in ONLY_IN.get(outer, {layer}) or (path, outer) in CLOCK_ALLOWED
        if not allowed:
            found.append(f'{path}:{line}: {layer or "the package"} may not import {name}')
    return found


def test_every_module_is_in_a_layer() -> None:
    inside = [p.relative_to(TOP / PACKAGE).with_suffix('').parts[0] for p in MODULES]
    assert {layer_of(f'{PACKAGE}.{first}') for first in inside} == set(MAY_IMPORT)
    assert [first for first in inside if not layer_of(f'{PACKAGE}.{first}')] == ['__init__']


def test_imports_point_down() -> None:
    found = [line for p in MODULES for line in violations(
        p.relative_to(TOP / PACKAGE).as_posix(), p.read_text(encoding='utf-8'))]
    assert found == []


@pytest.mark.parametrize(('path', 'source'), [
    ('lie/so3.py', 'from manifold_mpc_ros.dynamics import lgvi'),
    ('lie/so3.py', 'from manifold_mpc_ros.config import AttitudeMpcConfig'),
    ('lie/so3.py', 'from .. import mpc'),
    ('lie/__init__.py', 'from ..sim import plant'),
    ('errors.py', 'import manifold_mpc_ros.lie.so3'),
    ('config.py', 'from manifold_mpc_ros.dynamics.lgvi import cayley_step'),
    ('dynamics/lgvi.py', 'from ..mpc.attitude_mpc import AttitudeMpc'),
    ('theory/design.py', 'from manifold_mpc_ros.dynamics.lgvi import lgvi_step'),
    ('theory/design.py', 'from manifold_mpc_ros.config import AttitudeMpcConfig'),
    ('theory/level.py', 'from ..problems.attitude import attitude_problem'),
    ('dynamics/symbolic.py', 'from manifold_mpc_ros.theory.manifold import Sphere'),
    ('problems/attitude.py', 'from manifold_mpc_ros.mpc.scaling import Array'),
    ('mpc/horizon.py', 'def f():\n    from manifold_mpc_ros.sim.plant import Plant'),
    ('sim/plant.py', 'from manifold_mpc_ros.nodes import simulator'),
    ('nodes/controller.py', 'from manifold_mpc_ros.cli import main'),
    ('mpc/horizon.py', 'from manifold_mpc_ros import AttitudeMpc'),
    ('__init__.py', 'from manifold_mpc_ros.nodes import controller'),
    ('sim/plant.py', 'import rclpy.node'),
    ('scenarios/scenario.py', 'from manifold_mpc_ros.bags import reader'),
    ('bags/reader.py', 'from manifold_mpc_ros.nodes import messages'),
    ('cli/record.py', 'from rosbags.rosbag2 import Reader'),
    ('cli/campaign.py', 'from distributed import Client'),
    ('sim/plant.py', 'from manifold_mpc_ros.campaigns.plan import CampaignPlan'),
    ('cli/demo.py', 'from nav_msgs.msg import Odometry'),
    ('mpc/attitude_mpc.py', 'importlib.import_module("rclpy")'),
    ('sim/closed_loop.py', 'import matplotlib.pyplot as plt'),
    ('nodes/controller.py', 'from rich.table import Table'),
    ('sim/plant.py', 'import time'),
    ('mpc/horizon.py', 'from time import perf_counter'),
])
def test_a_wrong_import_is_found(path: str, source: str) -> None:
    assert len(violations(path, source)) == 1


@pytest.mark.parametrize(('path', 'source'), [
    ('lie/so3.py', 'from ..errors import ManifoldMpcError\nimport numpy as np'),
    ('lie/so3.py', 'from . import symbolic'),
    ('theory/manifold.py', 'from manifold_mpc_ros.lie.symbolic import quaternion_log'),
    ('problems/attitude.py', 'from manifold_mpc_ros.dynamics.symbolic import cayley_step\n'
                             'from manifold_mpc_ros.theory.problem import ManifoldProblem\n'
                             'from manifold_mpc_ros.config import AttitudeMpcConfig'),
    ('mpc/attitude_mpc.py', 'import time'),
    ('config.py', 'from manifold_mpc_ros.config_checks import finite'),
    ('nodes/controller.py', 'import rclpy, time\nfrom manifold_mpc_ros import AttitudeMpc'),
    ('cli/main.py', 'import rich\nfrom manifold_mpc_ros.nodes import controller'),
    ('__init__.py', 'from .mpc.attitude_mpc import AttitudeMpc'),
])
def test_a_right_import_passes(path: str, source: str) -> None:
    assert violations(path, source) == []
