# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of another stack are read by its descriptions, with the types that the bag carries."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.feed import feed_of
from manifold_mpc_ros.lab.recording.bags.run import TopicNames, read_run
from manifold_mpc_ros.lab.recording.bags.translate import StackDescriptions
from manifold_mpc_ros.lie import so3

STAMPS = 'uint64 timestamp\nuint64 timestamp_sample\n'
FIELDS = {
    'px4_msgs/msg/VehicleAttitude': f'{STAMPS}float32[4] q\n',
    'px4_msgs/msg/VehicleAngularVelocity': f'{STAMPS}float32[3] xyz\n',
    'px4_msgs/msg/VehicleTorqueSetpoint': f'{STAMPS}float32[3] xyz\n'}
START_NS, BOOT_US, N = 1_700_000_000 * 10**9, 5_000_000, 6
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD = np.diag([1.0, -1.0, -1.0])
PX4 = TopicNames(stack=StackDescriptions('px4', '', 'px4', (0.5, 0.4, 0.3)))


def attitude(index: int) -> np.ndarray:
    """Return R_NB of a state, in ENU and FLU."""
    return so3.exp([0.1 * index, -0.2, 0.3])


def px4_bag(path: Path, *, attitudes: int = N, says: dict[str, Any] | None = None) -> Path:
    """Write what a vehicle and its controller say, twice a second; ``says``: its parameters."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for kind, fields in FIELDS.items():
        store.register(get_types_from_msg(fields, kind))
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {kind: writer.add_connection(topic, kind, typestore=store) for topic, kind in zip(
            ('/fmu/out/vehicle_attitude', '/fmu/out/vehicle_angular_velocity',
             '/fmu/in/vehicle_torque_setpoint'), FIELDS, strict=True)}

        def write(kind: str, received_ns: int, sample_us: int, values: Any) -> None:
            message = store.types[kind](sample_us + 10, sample_us, np.array(values, np.float32))
            writer.write(topics[kind], received_ns, store.serialize_cdr(message, kind))

        if says is not None:
            text = 'std_msgs/msg/String'
            latched = writer.add_connection(
                '/sat1/attitude_controller/description', text, typestore=store)
            writer.write(latched, START_NS, store.serialize_cdr(
                store.types[text](json.dumps({'parameters': says})), text))
        for index in range(N):
            sample_us, received_ns = BOOT_US + 500_000 * index, START_NS + 500_000_000 * index
            w, x, y, z = so3.quaternion_from_rotation(NED.T @ attitude(index) @ FRD)
            said, rates, torques = FIELDS
            if index < attitudes:
                write(said, received_ns, sample_us, (w, x, y, z))
            write(rates, received_ns + 1000, sample_us + 4000, (0.1, 0.2, 0.1 * index))
            write(torques, received_ns + 2000, 7, (0.2, 0.5, -1.0))
    return path


def test_states_and_torques_of_px4_are_those_of_the_vehicle(tmp_path: Path) -> None:
    run = read_run(px4_bag(tmp_path / 'bag'), PX4)
    assert run.warnings == ()
    assert run.states.stamp_ns.tolist() == [START_NS + 500_000_000 * i for i in range(N)]
    np.testing.assert_allclose(run.states.R_NB, [attitude(i) for i in range(N)], atol=1e-6)
    np.testing.assert_allclose(
        run.states.omega_BN_B, [(0.1, -0.2, -0.1 * i) for i in range(N)], atol=1e-7)
    # A command without a time of its own answers the state before it; half scale, FRD to FLU.
    assert run.commands.stamp_ns.tolist() == run.states.stamp_ns.tolist()
    np.testing.assert_allclose(run.commands.torque_B_n_m, [(0.1, -0.2, 0.3)] * N, atol=1e-7)


def test_a_bag_that_says_how_its_controller_heard_is_read_so(tmp_path: Path) -> None:
    run = read_run(px4_bag(tmp_path / 'bag', says={
        'state_source': 'px4', 'setpoint_source': 'nav', 'command_sink': 'px4',
        'full_scale_torque_n_m': [0.5, 0.4, 0.3]}))
    assert run.topics.stack == PX4.stack
    np.testing.assert_allclose(run.states.R_NB, [attitude(i) for i in range(N)], atol=1e-6)
    np.testing.assert_allclose(run.commands.torque_B_n_m, [(0.1, -0.2, 0.3)] * N, atol=1e-7)


def test_they_are_fed_to_a_controller_as_odometry(tmp_path: Path) -> None:
    feed = feed_of(read_run(px4_bag(tmp_path / 'bag'), PX4), ControllerConfig.from_yaml(
        Path(__file__).parents[2] / 'config/controller.yaml'))
    assert (feed.state_source, len(feed.states)) == ('odometry', N)


def test_what_is_not_in_the_bag_is_named(tmp_path: Path) -> None:
    bag = px4_bag(tmp_path / 'bag', attitudes=0)
    with pytest.raises(BagError, match='no state'):
        read_run(bag, PX4)
    with pytest.raises(BagError, match=r'0 topics, not one, are bsk/out/sc_states .*/fmu/out/'):
        read_run(bag, TopicNames(stack=StackDescriptions('basilisk')))
