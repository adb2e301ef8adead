# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Described states through the real control loop, whatever messages they come in.

The made-up stack has a pose and a twist of the same stamp, and measures the attitude of the world
in the body.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseStamped, TwistStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from properties import PROPERTY
from rclpy.clock import ROSClock
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from state_messages import state_message

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.description import PRESETS
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import (
    StateGate,
    StateSample,
)
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.solver_thread import SolveRequest
from manifold_mpc_ros.control.tick_time import ClockTime
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.state_input import StateInput

STAMP_NS = 10**9
CONFIG = AttitudeMpcConfig(
    inertia_kg_m2=np.diag([1.0, 0.9, 0.6]), step_s=0.5, horizon=2, attitude_weight=np.eye(3),
    rate_weight=np.diag([0.25, 0.35, 0.65]), torque_weight=2.0 * np.eye(3),
    max_torque_n_m=np.array([0.3, 0.2, 0.1]))


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
        self, kind: type, topic: str, callback: Callable[..., None], _qos: object, *, raw: bool,
    ) -> Subscription:
        assert raw
        self.callbacks[topic], self.kinds[topic] = callback, kind
        return Subscription(self._publishers)

    def get_clock(self) -> ROSClock:
        return ROSClock()

    def destroy_subscription(self, _subscription: Subscription) -> None:
        self.callbacks.popitem()

    def send(self, topic: str, message: Any, number: int | None = None) -> None:
        self.callbacks[topic](
            bytes(serialize_message(message)), {'publication_sequence_number': number})


@pytest.fixture(scope='module')
def made_up(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Describe the made-up stack."""
    document = yaml.safe_load((PRESETS / 'pose_twist.yaml').read_text())
    document['state']['attitude']['direction'] = 'world_to_body'
    path = tmp_path_factory.mktemp('description') / 'made_up.yaml'
    path.write_text(yaml.safe_dump(document))
    return str(path)


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


def test_two_messages_make_one_state_in_any_order(made_up: str) -> None:
    node, read = Listener(), []
    StateInput(node, made_up, QoSProfile(depth=1), lambda state, _info: read.append(state))
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


@settings(PROPERTY, max_examples=200)
@given(vector=st.tuples(*[st.floats(-1.5, 1.5)] * 3), rate=st.tuples(*[st.floats(-0.3, 0.3)] * 3))
def test_the_control_loop_commands_the_same_whatever_source_a_state_comes_from(
    made_up: str, vector: tuple[float, ...], rate: tuple[float, ...],
) -> None:
    R_NB, omega, torques = so3.exp(vector), np.array(rate), []
    sample = StateSample(STAMP_NS, R_NB, omega)
    sent = {
        'odometry': [('odometry', state_message('odometry', sample))],
        'imu': [('imu', state_message('imu', sample))],
        made_up: [('pose', pose(STAMP_NS, R_NB.T)), ('twist', twist(STAMP_NS, omega))]}
    for given_name, parts in sent.items():
        node, refusals = Listener(), []
        gate = StateGate('inertial', 'base_link', step_s=0.5, timeout_s=1.0, timed=True)
        loop = ControlLoop(Law(CONFIG, Late(), 1.0), gate, initial_setpoint='identity')
        StateInput(node, given_name, QoSProfile(depth=1), lambda raw, _info, loop=loop,
                   refusals=refusals: refusals.append(loop.receive(raw, STAMP_NS)))
        for topic, message in parts:
            node.send(topic, message)
        command = loop.tick(ClockTime(STAMP_NS))
        assert (refusals, command.mode) == ([None], Mode.FALLBACK)
        torques.append(command.torque_B_n_m)
    np.testing.assert_array_equal(torques[0], torques[1])
    np.testing.assert_allclose(torques[2], torques[0], rtol=0, atol=1e-14)


def test_frames_are_those_of_either_message_and_an_inactive_node_hears_nothing() -> None:
    node, read = Listener(), []
    states = StateInput(
        node, 'pose_twist', QoSProfile(depth=1), lambda state, _info: read.append(state))
    node.send('pose', pose(STAMP_NS, np.eye(3)))
    node.send('twist', twist(STAMP_NS, np.zeros(3), 'elsewhere'))
    assert (read[0].inertial_frame_id, read[0].body_frame_id) == ('inertial', 'elsewhere')
    node.send('twist', twist(STAMP_NS, np.zeros(3)))
    states.forget()
    node.send('pose', pose(STAMP_NS, np.eye(3)))
    node.active = False
    node.send('twist', twist(STAMP_NS, np.zeros(3)))
    assert len(read) == 1
    states.close()
    assert node.callbacks == {}


@pytest.mark.parametrize('publishers', [1, 2])
@pytest.mark.parametrize('topic', ['pose', 'twist'])
def test_two_publishers_in_turn_of_any_topic_are_told(publishers: int, topic: str) -> None:
    node, duplicates = Listener(publishers), []
    StateInput(node, 'pose_twist', QoSProfile(depth=1), lambda _state, _info: None,
               duplicates.append)
    message = {'pose': pose(STAMP_NS, np.eye(3)), 'twist': twist(STAMP_NS, np.zeros(3))}[topic]
    for number in range(1, 11):
        for offset in (0, 50):
            node.send(topic, message, number + offset)
    assert set(duplicates) == ({topic} if publishers == 2 else set())


@pytest.mark.parametrize(('preset', 'change', 'says'), [
    ('px4', {}, 'px4_msgs/msg/VehicleAttitude.*github.com/PX4/px4_msgs'),
    ('nav', {'type': 'nav_msgs/msg/Odometer'}, 'nav_msgs/msg/Odometer.*that package nav_msgs has'),
    ('nav', {'type': 'no_msgs/msg/State'}, 'no_msgs/msg/State.*build no_msgs in this workspace'),
    ('nav', {'field': 'pose.orientation'}, "nav_msgs/msg/Odometry to be .*'orientation'"),
    ('nav', {'field': 'header.frame_id'}, '0 numbers, not 4'),
    ('imu', {'absent': 'orientation_covariance[9]'}, 'state_source: .*Imu .*9 elements, not 10'),
])
def test_a_type_or_path_that_is_not_there_gets_one_sentence(
    tmp_path: Path, preset: str, change: dict[str, str], says: str,
) -> None:
    document = yaml.safe_load((PRESETS / f'{preset}.yaml').read_text())
    document['state']['attitude'].update(change)
    path = tmp_path / 'mine.yaml'
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(ConfigurationError, match=says) as caught:
        StateInput(Listener(), str(path), QoSProfile(depth=1), lambda _state, _info: None)
    assert '\n' not in str(caught.value)
