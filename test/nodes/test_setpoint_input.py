# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Latched setpoints: what was published before the start counts, once; no later one is lost."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from bench import Bench, odometry, valid
from geometry_msgs.msg import QuaternionStamped, Vector3Stamped
from lifecycle_msgs.msg import Transition
from rclpy.qos import DurabilityPolicy, QoSProfile

if TYPE_CHECKING:
    from harness import Rig

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def turned(angle_rad: float) -> QuaternionStamped:
    """Return a commanded turn about x."""
    setpoint = QuaternionStamped()
    setpoint.header.frame_id = 'inertial'
    setpoint.quaternion.x, setpoint.quaternion.w = math.sin(angle_rad / 2), math.cos(angle_rad / 2)
    return setpoint


def direction(_angle_rad: float) -> Vector3Stamped:
    """Return where body z points when tilted by 0.6 rad about x, as every state is."""
    setpoint = Vector3Stamped()
    setpoint.header.frame_id = 'inertial'
    setpoint.vector.y, setpoint.vector.z = -math.sin(0.6), math.cos(0.6)
    return setpoint


@pytest.mark.parametrize(('kind', 'topic', 'make', 'target'), [
    (QuaternionStamped, 'attitude_setpoint', turned, 'attitude'),
    (Vector3Stamped, 'direction_setpoint', direction, 'pointing')])
def test_a_latched_setpoint_from_before_the_start_counts_once(
    rig: Rig, kind: type, topic: str, make: Callable[[float], Any], target: str,
) -> None:
    """The body is where it asks for, and away from the identity: no torque."""
    latched = rig.node.create_publisher(kind, topic, LATCHED)
    latched.publish(make(0.6))
    bench = Bench(rig, use_sim_time=True, target=target)
    bench.until(lambda: bench.value('setpoints') == '1', 'the latched setpoint', valid)
    bench.until(lambda: bench.value('mode') == 'NOMINAL' and not bench.pulls(1e-6), 'rest', valid)
    if target == 'pointing':
        return
    plain = rig.node.create_publisher(kind, topic, 10)
    rig.until(lambda: plain.get_subscription_count() > 0, 'the controller')

    def again(_state: Any) -> None:
        """Publish: what came before the controller knew of the publisher is lost."""
        plain.publish(make(0.3))

    bench.until(lambda: bench.pulls(1e-3), 'torque', again)
    for _ in range(2):  # so that none of them is still on its way
        taken = len(bench.diagnostics)
        bench.until(lambda n=taken: len(bench.diagnostics) > n, 'diagnostics', valid)
    latched.publish(make(0.6))
    bench.until(lambda: not bench.pulls(1e-6), 'rest', valid)
    said = len(bench.diagnostics)
    bench.until(lambda: len(bench.diagnostics) > said + 1, 'diagnostics', valid)
    counted = int(bench.value('setpoints'))
    assert counted >= 3
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
        assert rig.transition('/attitude_controller', transition)
    bench.until(lambda: bench.value('setpoints') == str(counted + 1),
                'the setpoint after a new start', valid)
    assert 'QoS' not in bench.process.log
    assert odometry(1).child_frame_id == 'base_link'
