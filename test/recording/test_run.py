# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags as arrays: states, commands, setpoints, ticks; of our recorder and of other stacks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from synthetic import (
    KINDS,
    QOS,
    START_NS,
    STEP_NS,
    diagnostics,
    header,
    make,
    odometry,
    quaternion,
    raw,
    run_messages,
    tick_messages,
    vector,
    write_bag,
)

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.contents import BagTopic, RawMessage, RunDescription
from manifold_mpc_ros.lab.recording.bags.run import TopicNames, read_run
from manifold_mpc_ros.lab.recording.bags.writer import BagWriter
from manifold_mpc_ros.lie import so3

HALF = np.sqrt(0.5)


def setpoint(stamp_ns: int, xyzw: tuple[float, ...]) -> RawMessage:
    return raw('/attitude_setpoint', START_NS + stamp_ns, make(
        'geometry_msgs/QuaternionStamped', header=header(stamp_ns),
        quaternion=quaternion(*xyzw)))


def foreign(path: Path, messages: list[RawMessage]) -> Path:
    """Write a bag that our recorder knows nothing of."""
    with BagWriter(path) as writer:
        for topic in dict.fromkeys(message.topic for message in messages):
            writer.add_topic(BagTopic(topic, KINDS[topic], qos=(QOS,)))
        for message in messages:
            writer.write(message)
    return path


def test_the_arrays_of_a_run(whole: Path) -> None:
    run = read_run(whole)
    index = np.arange(6)
    assert run.warnings == ()
    assert run.outcome == 'complete'
    assert run.scenario is not None
    assert (run.scenario.name, run.scenario.duration_s) == ('synthetic', 2.0)
    assert run.description.backend == 'c'
    assert np.array_equal(run.states.stamp_ns, 1_000_000_000 + STEP_NS * index)
    assert np.allclose(run.states.time_s, 0.5 * index, rtol=0, atol=1e-12)
    assert np.array_equal(run.states.received_ns, START_NS + 1000 * index)
    assert np.allclose(run.states.R_NB, so3.exp(np.outer(np.pi - 0.1 * index, [0, 0, 1])),
                       rtol=0, atol=1e-14)
    assert np.allclose(run.states.omega_BN_B, np.outer(-0.01 * index, [0, 0, 1]), rtol=0, atol=0)
    assert np.allclose(run.error_rad, np.pi - 0.1 * index, rtol=0, atol=1e-12)
    assert np.allclose(run.commands.torque_B_n_m[:, 2], -0.3 + 0.01 * index, rtol=0, atol=1e-15)
    assert run.received_states is run.states
    assert np.array_equal(run.ticks.tick, index + 1)
    assert np.array_equal(run.ticks.cost, 40.0 - index)
    assert np.allclose(run.ticks.solve_time_s, 81.5e-6)
    assert np.isnan(run.ticks.value_function).all()
    assert set(run.ticks.mode) == {'NOMINAL'}
    assert run.ticks.refused == 2
    assert len(run.predictions) == len(run.setpoints) == 0


def test_repeats_count_once(tmp_path: Path) -> None:
    """In lockstep a state that was published again, and its answer, are the same ones."""
    messages = run_messages(3)
    again = [*messages, *tick_messages(2)[:2]]
    run = read_run(write_bag(tmp_path / 'bag', again))
    assert (len(run.states), run.states.repeats) == (3, 1)
    assert (len(run.commands), run.commands.repeats) == (3, 1)


def test_ticks_beyond_the_last_command_are_left_out(tmp_path: Path) -> None:
    more = raw('/diagnostics', START_NS + 10**6, diagnostics(
        'attitude_controller', 1, 'later', {'ticks': '4', 'mode': 'COAST'}))
    other = raw('/diagnostics', START_NS + 10**6, diagnostics(
        'lgvi_simulator', 0, 'time runs', {'ticks': '3', 'mode': 'RUN'}))
    run = read_run(write_bag(tmp_path / 'bag', [*run_messages(3), more, other]))
    assert list(run.ticks.tick) == [1, 2, 3]
    assert run.ticks.last['mode'] == 'NOMINAL'


def test_setpoints_hold_from_their_stamp_on(tmp_path: Path) -> None:
    quarter = (0.0, 0.0, HALF, HALF)
    run = read_run(write_bag(tmp_path / 'bag', [
        setpoint(2_000_000_000, quarter), *run_messages(5)]))
    assert np.allclose(run.setpoints.time_s, [1.0])
    expected = [np.eye(3)] * 2 + [so3.exp([0.0, 0.0, np.pi / 2])] * 3
    assert np.allclose(run.R_ND, expected, rtol=0, atol=1e-15)
    assert np.allclose(run.error_rad[2:], np.pi / 2 - 0.1 * np.arange(2, 5), rtol=0, atol=1e-12)


def test_hold_means_the_first_attitude(tmp_path: Path) -> None:
    scenario = '{description: d, duration_s: 2.0, controller: {initial_setpoint: hold}}'
    run = read_run(write_bag(tmp_path / 'bag', run_messages(3), scenario=scenario))
    assert np.allclose(run.error_rad, 0.1 * np.arange(3), rtol=0, atol=1e-12)


def test_pointing_goes_by_the_axis(tmp_path: Path) -> None:
    """About z the axis z stays where it points, whatever the angle."""
    scenario = '{description: d, duration_s: 2.0, controller: {target: pointing}}'
    run = read_run(write_bag(tmp_path / 'bag', run_messages(3), scenario=scenario))
    assert np.allclose(run.error_rad, 0.0, rtol=0, atol=1e-12)


def test_an_imu_of_another_stack(tmp_path: Path) -> None:
    covariance = np.zeros(9)
    messages = [raw('/imu', START_NS + index, make(
        'sensor_msgs/Imu', header=header(10**9 + index), orientation=quaternion(0, 0, HALF, HALF),
        angular_velocity=vector((0.1, 0.2, 0.3)), orientation_covariance=covariance,
        angular_velocity_covariance=covariance)) for index in range(3)]
    run = read_run(foreign(tmp_path / 'bag', messages), TopicNames(state='/imu'))
    assert run.scenario is None
    assert run.outcome == ''
    assert run.states.omega_BN_B.tolist() == [[0.1, 0.2, 0.3]] * 3
    assert np.allclose(run.error_rad, np.pi / 2)
    assert len(run.commands) == 0


def test_pose_and_twist_are_joined_by_stamp(tmp_path: Path) -> None:
    pose = [raw('/pose', START_NS + i, make('geometry_msgs/PoseStamped', header=header(10**9 + i),
            pose=make('geometry_msgs/Pose', orientation=quaternion(0, 0, 1, 0))))
            for i in range(4)]
    twist = [raw('/twist', START_NS + i, make(
        'geometry_msgs/TwistStamped', header=header(10**9 + i),
        twist=make('geometry_msgs/Twist', angular=vector((i, 0, 0))))) for i in range(1, 5)]
    run = read_run(foreign(tmp_path / 'bag', [*pose, *twist]),
                   TopicNames(state='', pose='/pose', twist='/twist'))
    assert run.states.omega_BN_B[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert run.warnings == (
        '/pose with /twist: 1 of 5: no attitude; one that has it is 1e-09 s away or more',
        '/pose with /twist: 1 of 5: no rate; one that has it is 1e-09 s away or more')


def test_no_state_is_an_error_that_names_the_topics(tmp_path: Path) -> None:
    path = foreign(tmp_path / 'bag', [raw('/imu', START_NS, make(
        'sensor_msgs/Imu', header=header(10**9), orientation=quaternion(0, 0, 0, 1)))])
    with pytest.raises(BagError, match=r'no state .* on /odometry; .* /imu \(sensor_msgs/msg/Imu'):
        read_run(path)


def test_a_message_that_cannot_be_read_is_one_warning(tmp_path: Path) -> None:
    bad = odometry(5 * 10**9, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    messages = [*run_messages(2), raw('/odometry', START_NS + 10**6, bad),
                RawMessage('/odometry', START_NS + 10**6, 0, b'\x00\x01\x00\x00short')]
    run = read_run(write_bag(tmp_path / 'bag', messages))
    assert len(run.states) == 2
    unusable, unreadable = run.warnings
    assert unusable == '/odometry: 1 of 4: the quaternion (0, 0, 0, 0) is not of unit length'
    assert unreadable.startswith('/odometry: 1 of 4: could not be read as nav_msgs/msg/Odometry (')


def test_a_description_outlives_its_json() -> None:
    description = RunDescription('a', 'b', {'numpy': '2'}, 'c', {'x': [1.0]}, {}, {})
    assert RunDescription.from_json(description.to_json()) == description
    assert RunDescription.from_json('{"backend": "c", "later": 1, "versions": 3}') == \
        RunDescription(backend='c')
    with pytest.raises(ValueError, match='JSON'):
        RunDescription.from_json('[]')
