# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller over DDS, in lockstep, with a body whose source speaks another convention."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from bench import STEP_NS, Bench, odometry
from harness import stamp_ns, torque_of
from std_srvs.srv import Trigger

from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3

if TYPE_CHECKING:
    from harness import Rig

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
    body = Body(bench)
    for words, read in WRONG.items():
        body.tumble()
        for _ in range(6):
            body.step(read)
        rig.until(lambda w=words: w in bench.value('message'), words)
        assert bench.value('mode') == 'FAULT'
        assert bench.norms()[-5:].max() == 0.0  # but for the first state, there was no torque
        assert rig.call(Trigger, '/attitude_controller/reset', Trigger.Request()).success
    body.tumble()
    for _ in range(12):
        body.step(lambda R, w: (R, w))
    rig.until(lambda: bench.value('mode') == 'NOMINAL', 'the convention of the documents')
    assert bench.norms()[-12:].min() > 0.0
