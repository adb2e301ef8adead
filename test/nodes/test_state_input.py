# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""State sources through the real control loop: a second kind is one class and one entry.

The made-up kind joins a pose and a twist of the same stamp, in the world of a stack that measures
the attitude of the world in the body.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY
from rclpy.qos import QoSProfile

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.interfaces import (
    STATE_SOURCES,
    InterfaceKind,
    Topic,
    message_class,
    state_topics,
)
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import (
    RawState,
    Reason,
    Refusal,
    StateGate,
    StateSample,
)
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.solver_thread import SolveRequest
from manifold_mpc_ros.control.tick_time import ClockTime
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.state_input import StateInput

STAMP_NS = 10**9
CONFIG = AttitudeMpcConfig(
    inertia_kg_m2=np.diag([1.0, 0.9, 0.6]), step_s=0.5, horizon=2, attitude_weight=np.eye(3),
    rate_weight=np.diag([0.25, 0.35, 0.65]), torque_weight=2.0 * np.eye(3),
    max_torque_n_m=np.array([0.3, 0.2, 0.1]))


class PoseAndTwist:
    """Joins the newest pose and the newest twist when their stamps agree."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        self._latest: dict[str, Any] = {}

    def read(self, topic: str, message: Any) -> RawState | Refusal | None:
        self._latest[topic] = message
        pose, twist = (self._latest.get(name) for name in ('pose', 'twist'))
        if pose is None or twist is None or pose.header.stamp != twist.header.stamp:
            return None
        if twist.header.frame_id != 'base_link':
            return Refusal(Reason.WRONG_FRAME, f'the twist is in {twist.header.frame_id!r}')
        x, y, z, w = messages.quaternion_values(pose.pose.orientation)
        return RawState(
            messages.nanoseconds(pose.header.stamp), pose.header.frame_id, None, (-x, -y, -z, w),
            messages.vector_values(twist.twist.angular))


KIND = InterfaceKind(
    (Topic('pose', 'geometry_msgs/msg/PoseStamped', 'attitude'),
     Topic('twist', 'geometry_msgs/msg/TwistStamped', 'body rate')), f'{__name__}:PoseAndTwist')


class Subscription:
    """A subscription that says how many publish."""

    def __init__(self, publishers: int) -> None:
        self._publishers = publishers

    def get_publisher_count(self) -> int:
        return self._publishers


class Listener:
    """A node whose messages come from the test."""

    def __init__(self, publishers: int = 1) -> None:
        self.active = True
        self.callbacks: dict[str, Callable[..., None]] = {}
        self.kinds: dict[str, type] = {}
        self._publishers = publishers

    def listen(
        self, kind: type, topic: str, callback: Callable[..., None], _qos: object,
    ) -> Subscription:
        self.callbacks[topic], self.kinds[topic] = callback, kind
        return Subscription(self._publishers)

    def destroy_subscription(self, _subscription: Subscription) -> None:
        self.callbacks.popitem()

    def send(self, topic: str, message: Any, number: int | None = None) -> None:
        self.callbacks[topic](message, {'publication_sequence_number': number})


@pytest.fixture
def kind(monkeypatch: pytest.MonkeyPatch) -> str:
    """Add the made-up kind to the table."""
    monkeypatch.setitem(STATE_SOURCES, 'pose_and_twist', KIND)
    return 'pose_and_twist'


def pose(stamp_ns: int, R_BN: np.ndarray) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id, message.header.stamp = 'inertial', messages.to_stamp(stamp_ns)
    message.pose.orientation = messages.to_quaternion(R_BN)
    return message


def twist(stamp_ns: int, omega: np.ndarray, frame_id: str = 'base_link') -> TwistStamped:
    message = TwistStamped()
    message.header.frame_id, message.header.stamp = frame_id, messages.to_stamp(stamp_ns)
    message.twist.angular = messages.to_vector(omega)
    return message


def test_two_messages_make_one_state_in_any_order(kind: str) -> None:
    node, read = Listener(), []
    StateInput(node, kind, QoSProfile(depth=1), lambda state, _info: read.append(state))
    assert node.kinds == {'pose': PoseStamped, 'twist': TwistStamped}
    R_NB, omega = so3.exp([0.1, -0.2, 0.3]), np.array([0.1, 0.2, 0.3])
    node.send('pose', pose(STAMP_NS, R_NB.T))
    assert read == []  # half of it is none
    node.send('twist', twist(STAMP_NS, omega))
    node.send('twist', twist(STAMP_NS + 1, omega))
    node.send('pose', pose(STAMP_NS + 1, R_NB.T))
    gate = StateGate('inertial', 'base_link', step_s=0.5, timeout_s=1.0, timed=True)
    samples = [gate.admit(raw, STAMP_NS, received_ns=7) for raw in read]
    assert [sample.stamp_ns for sample in samples] == [STAMP_NS, STAMP_NS + 1]
    for sample in samples:
        assert isinstance(sample, StateSample)
        np.testing.assert_allclose(sample.R_NB, R_NB, atol=1e-15)
        np.testing.assert_array_equal(sample.omega_BN_B, omega)
        assert sample.received_ns == 7


class Late:
    """A solver whose results never come: the loop falls back on what it knows of the state."""

    def solve(self, _request: SolveRequest) -> None:
        """Return nothing."""

    def late_result(self) -> None:
        """Return nothing."""

    def close(self) -> None:
        """Do nothing."""


@PROPERTY
@given(vector=st.tuples(*[st.floats(-1.5, 1.5)] * 3), rate=st.tuples(*[st.floats(-0.3, 0.3)] * 3))
def test_the_control_loop_commands_the_same_whatever_source_a_state_comes_from(
    vector: tuple[float, ...], rate: tuple[float, ...],
) -> None:
    R_NB, omega, torques = so3.exp(vector), np.array(rate), []
    form = messages.StateFormat('inertial', 'base_link', 0.0, 0.0)
    sample = StateSample(STAMP_NS, R_NB, omega)
    sent = {
        'odometry': [('odometry', messages.to_odometry(sample, form))],
        'imu': [('imu', messages.to_imu(sample, form))],
        'pose_and_twist': [('pose', pose(STAMP_NS, R_NB.T)), ('twist', twist(STAMP_NS, omega))]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(STATE_SOURCES, 'pose_and_twist', KIND)
        for kind, parts in sent.items():
            node, refusals = Listener(), []
            gate = StateGate('inertial', 'base_link', step_s=0.5, timeout_s=1.0, timed=True)
            loop = ControlLoop(Law(CONFIG, Late(), 1.0), gate, initial_setpoint='identity')
            StateInput(node, kind, QoSProfile(depth=1), lambda raw, _info, loop=loop,
                       refusals=refusals: refusals.append(loop.receive(raw, STAMP_NS)))
            for topic, message in parts:
                node.send(topic, message)
            command = loop.tick(ClockTime(STAMP_NS))
            assert (refusals, command.mode) == ([None], Mode.FALLBACK)
            torques.append(command.torque_B_n_m)
    np.testing.assert_array_equal(torques[0], torques[1])
    np.testing.assert_allclose(torques[2], torques[0], rtol=0, atol=1e-14)


def test_a_source_may_refuse_and_forgets_and_an_inactive_node_hears_nothing(kind: str) -> None:
    node, read = Listener(), []
    states = StateInput(node, kind, QoSProfile(depth=1), lambda state, _info: read.append(state))
    node.send('pose', pose(STAMP_NS, np.eye(3)))
    node.send('twist', twist(STAMP_NS, np.zeros(3), 'elsewhere'))
    assert [state.reason for state in read] == [Reason.WRONG_FRAME]
    states.forget()
    node.send('twist', twist(STAMP_NS, np.zeros(3)))
    node.active = False
    node.send('pose', pose(STAMP_NS, np.eye(3)))
    assert len(read) == 1
    states.close()
    assert node.callbacks == {}


@PROPERTY
@given(publishers=st.integers(1, 2), topic=st.sampled_from(['pose', 'twist']))
def test_two_publishers_in_turn_of_any_topic_are_told(publishers: int, topic: str) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(STATE_SOURCES, 'pose_and_twist', KIND)
        node, duplicates = Listener(publishers), []
        StateInput(node, 'pose_and_twist', QoSProfile(depth=1), lambda _state, _info: None,
                   duplicates.append)
    message = {'pose': pose(STAMP_NS, np.eye(3)), 'twist': twist(STAMP_NS, np.zeros(3))}[topic]
    for number in range(1, 11):
        for offset in (0, 50):
            node.send(topic, message, number + offset)
    assert set(duplicates) == ({topic} if publishers == 2 else set())


def test_the_table_is_the_one_place_that_knows_the_sources() -> None:
    """Every kind can be loaded, its message types exist, and --help shows its topics."""
    shown = {(name, message_type) for name, message_type, _meaning in state_topics()}
    for source in STATE_SOURCES.values():
        read = source.load()()
        assert callable(read.read)
        read.forget()
        for topic in source.topics:
            assert (topic.name, topic.message_type) in shown
            assert message_class(topic.message_type).__name__ in topic.message_type
