# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The core imports and works where there is no ROS."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

TOP = Path(__file__).parents[2]

# Names that a machine without ROS does not have; finding one is an ImportError there.
BLOCK = """
import sys

class NoRos:
    names = {'ament_index_python', 'launch', 'launch_ros', 'rcl_interfaces', 'rclpy', 'rpyutils'}

    def find_spec(self, name, path=None, target=None):
        first = name.partition('.')[0]
        if first in self.names or first.endswith(('_msgs', '_srvs', '_interfaces')):
            raise ModuleNotFoundError(f'{first} is blocked', name=first)

sys.meta_path.insert(0, NoRos())
"""

IMPORT_EVERYTHING_BUT_NODES = """
import importlib, pkgutil
import manifold_mpc_ros
imported = [
    importlib.import_module(found.name).__name__
    for found in pkgutil.walk_packages(manifold_mpc_ros.__path__, 'manifold_mpc_ros.')
    if '.nodes.' not in found.name and not found.name.endswith('latency_probe')
]
print(*imported)
"""

USE_THE_CORE = """
import numpy as np
from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig, TerminalDesign, lgvi_step
J, R0, w0 = np.diag([1.0, 0.9, 0.6]), np.diag([-1.0, -1.0, 1.0]), np.zeros(3)
config = AttitudeMpcConfig(
    inertia_kg_m2=J, step_s=0.5, horizon=10, attitude_weight=np.eye(3),
    rate_weight=np.trace(J) / 2 * np.eye(3) - J, torque_weight=2 * np.eye(3), terminal_scale=0.1)
mpc = AttitudeMpc(config)
assert isinstance(mpc.terminal, TerminalDesign)
solution = mpc.solve(R0, w0)
R1, w1 = lgvi_step(R0, w0, solution.torque_B_n_m, inertia_kg_m2=J, step_s=0.5)
print(solution.status.value, float(np.linalg.norm(w1)))
"""


def run(program: str) -> list[str]:
    """Run the program in a fresh interpreter with the checkout on its path; return its words."""
    path = os.pathsep.join([str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])
    environment = dict(os.environ, PYTHONPATH=path)
    done = subprocess.run([sys.executable, '-c', program], env=environment, text=True,
                          capture_output=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_the_block_blocks() -> None:
    assert run(BLOCK + """
try:
    import nav_msgs.msg
except ModuleNotFoundError as error:
    print(error.name)
""") == ['nav_msgs']


def test_every_module_outside_nodes_imports_without_ros() -> None:
    imported = run(BLOCK + IMPORT_EVERYTHING_BUT_NODES)
    assert {'manifold_mpc_ros.lie.so3', 'manifold_mpc_ros.dynamics.lgvi',
            'manifold_mpc_ros.mpc.attitude_mpc', 'manifold_mpc_ros.lab.closed_loop',
            'manifold_mpc_ros.cli.main'} <= set(imported)


def test_the_core_works_without_ros() -> None:
    status, rate = run(BLOCK + USE_THE_CORE)
    assert status in ('converged', 'feasible')
    assert float(rate) > 0.0
