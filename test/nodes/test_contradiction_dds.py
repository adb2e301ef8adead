# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller over DDS, in lockstep, with a body whose source speaks another convention."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from bench import STEP_NS, Bench, odometry
from geometry_msgs.msg import WrenchStamped
from harness import stamp_ns, torque_of
from rcl_interfaces.msg import Log
from std_srvs.srv import Trigger

from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3

if TYPE_CHECKING:
    from harness import Rig

ERROR = Log.ERROR
FLOOD = 3000
J = np.diag([1.0, 0.9, 0.6])
STEPS = 100
WRONG = {
    'the rate is in the inertial (parent) frame': lambda R, w: (R, R @ w),
    'the rate is in deg/s': lambda R, w: (R, np.rad2deg(w)),
    'the quaternion is inverse (inertial to body)': lambda R, w: (R.T, w),
}


class Body:
    """A tilted body that turns; its states go to the controller, the answers act on it."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.now_ns = 10**9

    def tumble(self) -> None:
        """Start as the field's example does."""
        self.R_NB, self.omega_BN_B = so3.exp([2.0, 1.5, 0.5]), np.array([0.2, -0.15, 0.1])

    def step(self, read) -> None:  # noqa: ANN001
        """Publish the state as the source reads it, and move on under the answer."""
        bench, self.now_ns = self.bench, self.now_ns + STEP_NS
        R, omega = read(self.R_NB, self.omega_BN_B)
        w, x, y, z = so3.quaternion_from_rotation(R).tolist()
        state = odometry(self.now_ns, (x, y, z, w))
        rate = state.twist.twist.angular
        rate.x, rate.y, rate.z = omega.tolist()
        bench.rig.until(
            lambda: bool(bench.torques) and stamp_ns(bench.torques[-1]) == self.now_ns,
            'an answer', meanwhile=lambda: bench.states.publish(state))
        for _ in range(STEPS):
            self.R_NB, self.omega_BN_B = lgvi_step(
                self.R_NB, self.omega_BN_B, torque_of(bench.torques[-1]), inertia_kg_m2=J,
                step_s=STEP_NS / 1e9 / STEPS)


def test_a_source_in_another_convention_is_stopped_and_named(rig: Rig) -> None:
    bench = Bench(rig, lockstep=True)
    body, log = Body(bench), rig.watch(Log, '/rosout')
    for words, read in WRONG.items():
        body.tumble()
        for _ in range(6):
            body.step(read)
        rig.until(lambda w=words: w in bench.value('message'), words)
        assert bench.value('mode') == 'FAULT'
        assert bench.norms()[-6:].max() == 0.0
        rig.until(lambda w=words: [w in line.msg for line in log if line.level == ERROR
                                   and line.msg.startswith('FAULT: ')].count(True) == 1, 'FAULT')
        assert rig.call(Trigger, '/attitude_controller/reset', Trigger.Request()).success
    body.tumble()
    for _ in range(12):
        body.step(lambda R, w: (R, w))
    rig.until(lambda: bench.value('mode') == 'NOMINAL', 'the convention of the documents')
    assert bench.norms()[-11:].min() > 0.0


def test_a_flood_of_bad_states_has_few_lines_and_another_publisher_of_torque_is_named(
    rig: Rig,
) -> None:
    bench, log = Bench(rig, lockstep=True), rig.watch(Log, '/rosout')
    bad = odometry(10**9, (0.0, 0.0, 0.0, 0.0))
    began_s = time.monotonic()
    for k in range(FLOOD):
        bad.header.frame_id = ('inertial', 'odom')[k % 2]
        bench.states.publish(bad)
    rig.until(lambda: bench.value('refused.odometry.wrong_frame') != '', 'refusals')
    rig.until(lambda: any("frame is 'odom'" in line.msg for line in log), 'a line of one kind')
    rig.until(lambda: any('the norm of the quaternion' in line.msg for line in log), 'the other')
    lines = [line.msg for line in log if line.msg.startswith('refused ')]
    assert len(lines) <= 1 + (time.monotonic() - began_s)
    rig.node.create_publisher(WrenchStamped, 'torque_command', 1)
    rig.until(lambda: bench.value('other_publishers') == '/watcher on /torque_command', 'it')
    rig.until(lambda: any('come from /watcher on' in line.msg for line in log), 'the log')
