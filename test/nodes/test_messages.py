# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages and plain values: there and back, and what is in each field."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')


from state_messages import state_message

from manifold_mpc_ros.config.description import state_description
from manifold_mpc_ros.control.described.source import DescribedSource
from manifold_mpc_ros.control.input_gate import StateGate, StateSample
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.nodes import messages

STAMP_NS = 5_000_000_001


def samples() -> list[StateSample]:
    rng = np.random.default_rng(11)
    half_turn = np.diag([-1.0, -1.0, 1.0])
    return [StateSample(STAMP_NS, R, rng.standard_normal(3))
            for R in [np.eye(3), half_turn, *so3.random_rotations(rng, 20)]]


@pytest.mark.parametrize('kind', ['odometry', 'imu'])
def test_a_state_survives_the_way_through_a_message(kind: str) -> None:
    take = DescribedSource(state_description(kind))
    for sample in samples():
        gate = StateGate('inertial', 'base_link', step_s=0.5, timeout_s=1.0, timed=True)
        back = gate.admit(take.read(kind, state_message(kind, sample), 0), STAMP_NS)
        assert isinstance(back, StateSample)
        assert back.stamp_ns == STAMP_NS
        np.testing.assert_allclose(back.R_NB, sample.R_NB, atol=4e-16)
        np.testing.assert_array_equal(back.omega_BN_B, sample.omega_BN_B)


def test_quaternions_are_xyzw() -> None:
    quaternion = messages.to_quaternion(so3.exp([0.0, 0.0, np.pi / 2.0]))
    np.testing.assert_allclose(
        messages.quaternion_values(quaternion), [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)],
        atol=1e-15)


def test_frames_and_covariances() -> None:
    sample = samples()[3]
    odometry, imu = state_message('odometry', sample), state_message('imu', sample)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ('inertial', 'base_link')
    assert imu.header.frame_id == 'base_link'
    np.testing.assert_array_equal(
        np.diag(np.reshape(odometry.pose.covariance, (6, 6))), [0, 0, 0, 1e-4, 1e-4, 1e-4])
    np.testing.assert_array_equal(
        np.diag(np.reshape(odometry.twist.covariance, (6, 6))), [0, 0, 0, 1e-6, 1e-6, 1e-6])
    assert imu.orientation_covariance[0] == 1e-4
    assert imu.angular_velocity_covariance[8] == 1e-6
    assert imu.linear_acceleration_covariance[0] == -1.0


def test_an_imu_without_orientation_or_rate_says_so() -> None:
    imu = state_message('imu', samples()[0])
    source = DescribedSource(state_description('imu'))
    assert source.read('imu', imu, 0).has_attitude
    imu.orientation_covariance[0] = -1.0
    assert not source.read('imu', imu, 0).has_attitude
    assert source.read('imu', imu, 0).has_rate
    imu.angular_velocity_covariance[0] = -1.0
    assert not source.read('imu', imu, 0).has_rate


def test_a_torque_has_no_force() -> None:
    wrench = messages.to_torque(STAMP_NS, np.array([0.1, -0.2, 0.3]), 'base_link')
    assert messages.nanoseconds(wrench.header.stamp) == STAMP_NS
    assert messages.vector_values(wrench.wrench.torque) == (0.1, -0.2, 0.3)
    force = wrench.wrench.force
    assert (force.x, force.y, force.z) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('stamp_ns', [1, 999_999_999, 10**9, 1_795_000_000_123_456_789])
def test_stamps_survive(stamp_ns: int) -> None:
    assert messages.nanoseconds(messages.to_stamp(stamp_ns)) == stamp_ns


def test_a_prediction_is_a_curve_on_the_unit_sphere_in_time() -> None:
    attitudes = np.array([so3.exp([0.0, 0.0, 0.1 * k]) for k in range(4)])
    path = messages.to_path(STAMP_NS, 0.5 * np.arange(len(attitudes)), attitudes, 'inertial')
    assert [messages.nanoseconds(pose.header.stamp) for pose in path.poses] == [
        STAMP_NS + k * 500_000_000 for k in range(4)]
    for pose, R in zip(path.poses, attitudes, strict=True):
        point = pose.pose.position
        np.testing.assert_allclose([point.x, point.y, point.z], R @ [1.0, 0.0, 0.0])


def test_diagnostics_are_text() -> None:
    array = messages.to_diagnostics(STAMP_NS, 'node', b'\x01', 'why', {'a': 1, 'b': 0.123456789})
    (status,) = array.status
    assert (status.name, status.level, status.message) == ('node', b'\x01', 'why')
    assert [(pair.key, pair.value) for pair in status.values] == [('a', '1'), ('b', '0.123457')]
