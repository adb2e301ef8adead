# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulator over DDS against torques that must not act; the test is the controller."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from harness import stamp_ns
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger
from watching import rate_rad_s, values_of

if TYPE_CHECKING:
    from harness import Rig

NODE = 'lgvi_simulator'
MAX_TORQUE_N_M = 0.3  # about x, where the moment of inertia is 1 kg m^2
FAST = {'plant.step_s': 0.01, 'timing.state_period_s': 0.02, 'timing.control_period_s': 0.1}


class Commands:
    """A simulator in real time, and a publisher of torques that answer its latest state."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.states = rig.watch(Odometry, 'odometry')
        self.diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
        self.publisher = rig.node.create_publisher(WrenchStamped, 'torque_command', 10)
        self.process = rig.start('simulator', parameters=FAST)
        rig.until(lambda: bool(self.states) and self.publisher.get_subscription_count() > 0,
                  'the simulator')

    def value(self, key: str) -> str:
        return values_of(self.diagnostics, NODE).get(key, '0')

    def message(self, x: float, *, age_s: float = 0.0, frame: str = 'base_link') -> WrenchStamped:
        """Return a torque about x [N m] that answers a state of this age."""
        at_ns = stamp_ns(self.states[-1]) - round(age_s * 1e9)
        message = WrenchStamped()
        message.header.frame_id = frame
        message.header.stamp = Time(sec=at_ns // 10**9, nanosec=at_ns % 10**9)
        message.wrench.torque.x = x
        return message

    def until(self, condition: Callable[[], bool], what: str, **form: Any) -> None:
        """Publish a torque, each time in answer to the latest state, until a condition holds."""
        def publish() -> None:
            if form:
                self.publisher.publish(self.message(**form))

        self.rig.until(condition, what, meanwhile=publish)

    def rate(self) -> float:
        return float(rate_rad_s(self.states[-1])[0])


def test_only_a_fresh_finite_torque_in_the_body_frame_acts_and_within_the_limits(
    rig: Rig,
) -> None:
    commands = Commands(rig)
    for key, form in (
        ('non_finite', {'x': math.nan}),
        ('non_finite', {'x': math.inf}),
        ('wrong_frame', {'x': 0.3, 'frame': 'inertial'}),
        ('stale', {'x': 0.3, 'age_s': 30.0}),
    ):
        before = int(commands.value(f'refused.torque_command.{key}'))
        commands.until(lambda k=key, n=before: int(
            commands.value(f'refused.torque_command.{k}')) > n + 2, key, **form)
        assert commands.rate() == 0.0
    good = bytes(serialize_message(commands.message(0.3)))
    for data in (b'', good[:-12], good[:20], b'\xff' * 80):
        commands.publisher.publish(data)
    rig.more(commands.states, 5, 'states')
    assert commands.rate() == 0.0

    commands.until(lambda: commands.rate() > 0.01, 'motion', x=1e12)
    later, earlier = commands.states[-1], commands.states[-2]
    gained = float(rate_rad_s(later)[0] - rate_rad_s(earlier)[0])  # and not 1e10 rad/s
    assert gained <= MAX_TORQUE_N_M * (stamp_ns(later) - stamp_ns(earlier)) / 1e9 + 1e-9
    commands.until(lambda: int(commands.value('saturated')) > 0, 'the clipped torque')
    commands.until(lambda: int(commands.value('expired_commands')) > 0, 'the end of its life')
    rig.more(commands.states, 5, 'states')
    rate = commands.rate()
    rig.more(commands.states, 5, 'states')
    assert commands.rate() == pytest.approx(rate, abs=1e-6)
    assert all(math.isfinite(x) for state in commands.states for x in rate_rad_s(state))
    assert commands.value('exceptions') == '0'


def test_two_publishers_of_the_torque_latch_zero_until_a_reset(rig: Rig) -> None:
    commands = Commands(rig)
    second = rig.node.create_publisher(WrenchStamped, 'torque_command', 10)
    rig.until(lambda: second.get_subscription_count() > 0, 'the simulator')

    def both() -> None:
        commands.publisher.publish(commands.message(0.3))
        second.publish(commands.message(-0.1))

    rig.until(lambda: commands.value('torque_latched') == 'True', 'the latch', meanwhile=both)
    message = values_of(commands.diagnostics, NODE)['message']
    assert message == 'two publishers of torque_command (zero until ~/reset)'
    rig.node.destroy_publisher(second)
    rig.more(commands.states, 5, 'states')
    rate, states = commands.rate(), len(commands.states)
    commands.until(lambda: len(commands.states) > states + 10, 'states', x=0.3)
    assert commands.rate() == pytest.approx(rate, abs=1e-6)
    assert rig.call(Trigger, f'/{NODE}/reset', Trigger.Request()).success
    commands.until(lambda: commands.rate() > 0.01, 'motion after the reset', x=0.3)
