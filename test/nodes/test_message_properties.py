# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Message conversions: what goes out comes in again, and any message comes in as values."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY, any_text, any_vector, finite_vector, quaternions, rotations

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from state_messages import state_message

from manifold_mpc_ros.config.description import state_description
from manifold_mpc_ros.control.described.source import DescribedSource
from manifold_mpc_ros.control.input_gate import RawState, Refusal, StateGate, StateSample
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.nodes import messages

stamps_ns = st.integers(1, 2**31 * 10**9 - 1)
times = st.builds(Time, sec=st.integers(-2**31, 2**31 - 1), nanosec=st.integers(0, 2**32 - 1))


def gate() -> StateGate:
    return StateGate('inertial', 'base_link', step_s=0.5, timeout_s=2.5, timed=False)


def read(topic: str, message: Imu | Odometry) -> RawState:
    """Return the state of a message on the topic of a shipped description of that name."""
    state = DescribedSource(state_description(topic)).read(topic, message, 0)
    assert isinstance(state, RawState)
    return state


@PROPERTY
@given(stamp_ns=stamps_ns, R_NB=rotations(), omega=finite_vector, by_imu=st.booleans())
def test_a_state_survives_its_message(
    stamp_ns: int, R_NB: np.ndarray, omega: tuple, by_imu: bool,
) -> None:
    sample = StateSample(stamp_ns, R_NB, np.array(omega))
    kind = 'imu' if by_imu else 'odometry'
    raw = read(kind, state_message(kind, sample))
    again = gate().admit(raw, stamp_ns)
    assert not isinstance(again, Refusal)
    assert again.stamp_ns == stamp_ns
    assert so3.angle(again.R_NB.T @ R_NB) < 1e-14
    assert tuple(again.omega_BN_B) == omega


@PROPERTY
@given(stamp_ns=stamps_ns, torque=finite_vector)
def test_a_torque_survives_its_message_to_the_bit(stamp_ns: int, torque: tuple) -> None:
    message = messages.to_torque(stamp_ns, np.array(torque), 'base_link')
    assert messages.vector_values(message.wrench.torque) == torque
    assert messages.nanoseconds(message.header.stamp) == stamp_ns
    force = message.wrench.force
    assert (force.x, force.y, force.z) == (0.0, 0.0, 0.0)


@PROPERTY
@given(stamp=times, frames=st.tuples(any_text, any_text), quaternion=quaternions(),
       rate=any_vector)
def test_any_odometry_is_admitted_or_refused(
    stamp: Any, frames: tuple[str, str], quaternion: tuple, rate: tuple,
) -> None:
    message = Odometry(child_frame_id=frames[0])
    message.header.frame_id, message.header.stamp = frames[1], stamp
    x, y, z, w = quaternion
    message.pose.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
    message.twist.twist.angular = Vector3(x=rate[0], y=rate[1], z=rate[2])
    admitted = gate().admit(read('odometry', message), 10**9)
    if not isinstance(admitted, Refusal):
        assert np.isfinite(admitted.R_NB).all()
        assert np.isfinite(admitted.omega_BN_B).all()
        assert frames == ('base_link', 'inertial')
