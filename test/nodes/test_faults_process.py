# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Processes that die, freeze, hang or come back: the loop closes again by itself."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from harness import Rig, torque_of
from nav_msgs.msg import Odometry
from own_time import LONGEST_END_S, OwnTime, seconds_to_end
from watching import values_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from harness import Process

STEP_S = 0.1
CONTROLLER = {'mpc.step_s': STEP_S, 'mpc.terminal_constraint': False}
SIMULATOR = {
    'plant.step_s': 0.01, 'timing.state_period_s': 0.02, 'timing.control_period_s': STEP_S,
    # or there would be nothing to command after a while
    'plant.disturbance_torque_n_m': [0.05, 0.0, 0.0],
}
HANGING = '''
"""A controller whose solver hangs while a file is there."""
import sys, time
from pathlib import Path
from manifold_mpc_ros.nodes.controller.main import PROGRAM
from manifold_mpc_ros.nodes.controller.node import AttitudeControllerNode

class Hanging:
    def __init__(self, solver):
        self.solver = solver

    def __getattr__(self, name):
        return getattr(self.solver, name)

    def solve(self, *state, **budget):
        while Path('hang').exists():
            time.sleep(0.01)
        return self.solver.solve(*state, **budget)

class HangingControllerNode(AttitudeControllerNode):
    def make_solver(self, config, terminal):
        return Hanging(super().make_solver(config, terminal))

if __name__ == '__main__':
    from manifold_mpc_ros.nodes.process import run
    run(PROGRAM, 'hanging:HangingControllerNode')
'''


class Loop:
    """Both nodes as processes in real time, ten ticks a second, and what they say."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.torques = rig.watch(WrenchStamped, 'torque_command')
        self.states = rig.watch(Odometry, 'odometry')
        self.diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
        self.simulator = self.start_simulator()

    def start_simulator(self) -> Process:
        return self.rig.start('simulator', parameters=SIMULATOR)

    def start_controller(self) -> Process:
        return self.rig.start('controller', parameters=CONTROLLER)

    def value(self, key: str, node: str = 'attitude_controller') -> str:
        return values_of(self.diagnostics, node).get(key, '')

    def said(self, key: str) -> list[str]:
        """Return the controller's values of a key, in their order."""
        return [values_of([array], 'attitude_controller').get(key, '')
                for array in self.diagnostics]

    def until(self, condition: Callable[[], bool], what: str) -> None:
        self.rig.until(condition, what, alive=False)

    def until_closed(self) -> None:
        """Wait for a new torque of the optimiser that the plant has, and a word of both nodes."""
        self.diagnostics.clear()
        self.torques.clear()
        self.until(lambda: self.value('mode') == 'NOMINAL' and len(self.torques) > 5
                   and any(torque_of(self.torques[-1]))
                   and self.value('commands_in_force', 'lgvi_simulator') == '1', 'the closed loop')

    def finite_and_limited(self) -> bool:
        torques = np.array([torque_of(message) for message in self.torques])
        return bool(np.isfinite(torques).all() and (np.abs(torques) <= 0.3).all())


def test_either_node_may_be_killed_frozen_and_started_again(rig: Rig) -> None:
    loop = Loop(rig)
    controller = loop.start_controller()
    loop.until_closed()

    controller.signal(signal.SIGKILL)  # the plant's own time to live ends the last torque
    expired = int(loop.value('expired_commands', 'lgvi_simulator'))
    loop.until(lambda: int(loop.value('expired_commands', 'lgvi_simulator')) > expired,
               'zero at the plant')
    controller = loop.start_controller()
    loop.until_closed()

    loop.simulator.signal(signal.SIGKILL)
    loop.until(lambda: loop.value('mode') == 'COAST', 'no states')
    loop.until(lambda: not any(torque_of(loop.torques[-1])), 'zero torque')
    loop.simulator = loop.start_simulator()
    loop.until_closed()

    loop.simulator.signal(signal.SIGSTOP)
    loop.until(lambda: loop.value('mode') == 'COAST', 'no states')
    loop.simulator.signal(signal.SIGCONT)
    loop.until_closed()

    ticks, missed = int(loop.value('ticks')), int(loop.value('missed_ticks'))
    expired = int(loop.value('expired_commands', 'lgvi_simulator'))  # of the last simulator
    controller.signal(signal.SIGSTOP)
    loop.until(lambda: int(loop.value('expired_commands', 'lgvi_simulator')) > expired,
               'zero at the plant')
    begun = time.monotonic()
    while time.monotonic() - begun < 10 * STEP_S:
        rig.settle()
    controller.signal(signal.SIGCONT)
    loop.until_closed()
    loop.until(lambda: int(loop.value('missed_ticks')) >= missed + 10, 'missed ticks')
    gained = int(loop.value('ticks')) - ticks
    assert gained * STEP_S < time.monotonic() - begun + 1.0  # skipped, not made up for
    assert loop.finite_and_limited()
    assert loop.value('exceptions') == '0'
    for process in (controller, loop.simulator):
        assert 'Traceback' not in process.log


def test_a_solver_that_hangs_delays_no_tick(rig: Rig, tmp_path: Path) -> None:
    (tmp_path / 'hanging.py').write_text(HANGING, encoding='utf-8')
    loop = Loop(rig)
    controller = run_hanging(rig)
    loop.until_closed()
    (tmp_path / 'hang').touch()
    loop.until(lambda: ('HOLD', 'the solver is late') in zip(
        loop.said('mode'), loop.said('message')), 'the stored plan')
    loop.until(lambda: loop.value('mode') == 'FALLBACK', 'the fallback law')
    taken, ticks = OwnTime(controller.pid), int(loop.value('ticks'))
    rig.until(lambda: int(loop.value('ticks')) >= ticks + 20, 'ticks with a hung solver',
              meanwhile=taken.look)
    assert taken.look() < 20 * STEP_S * 1.5 + 1.0
    loop.until(lambda: loop.value('mode') == 'FALLBACK', 'still the fallback law')
    (tmp_path / 'hang').unlink()
    loop.until_closed()
    assert loop.finite_and_limited()
    loop.diagnostics.clear()
    (tmp_path / 'hang').touch()  # and it does not keep the process from ending
    loop.until(lambda: 'HOLD' in loop.said('mode'), 'the stored plan')
    assert seconds_to_end(controller, signal.SIGTERM) < LONGEST_END_S


def run_hanging(rig: Rig) -> Process:
    """Start the controller whose solver hangs on demand."""
    arguments: list[str] = ['hanging', '--ros-args']
    for name, value in CONTROLLER.items():
        arguments += ['-p', f'{name}:={ros_text(value)}']
    return rig.run(arguments)


def ros_text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
