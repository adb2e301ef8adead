# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every configuration mistake: both nodes refuse to configure, with one message each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

import rclpy
from harness import file_with
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions

from manifold_mpc_ros.cli.processes import reserved_domain
from manifold_mpc_ros.nodes.controller import main as controller
from manifold_mpc_ros.nodes.controller.node import AttitudeControllerNode
from manifold_mpc_ros.nodes.simulator import main as simulator
from manifold_mpc_ros.nodes.simulator.node import LgviSimulatorNode

PROGRAMS = {
    'controller': (AttitudeControllerNode, controller.PROGRAM),
    'simulator': (LgviSimulatorNode, simulator.PROGRAM),
}
INERTIA = 'spacecraft.inertia_kg_m2'
NAN = math.nan

CONTROLLER: list[tuple[str, Any, str]] = [
    ('mpc.horizon', None, 'missing'),
    ('limits.max_torque_n_m', None, 'missing'),
    (INERTIA, [1.0, 0.9], '3 or 9 numbers'),
    (INERTIA, [1.0, NAN, 0.6], 'finite'),
    (INERTIA, [1.0, 0.1, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 0.6], 'symmetric'),
    (INERTIA, [1.0, -0.9, 0.6], 'positive principal moments'),
    (INERTIA, [1.0, 0.3, 0.6], 'J_1 + J_2 > J_3'),
    ('mpc.attitude_weight', [1.0, 0.0, 0.0], 'tr(Q) I - Q'),
    ('mpc.rate_weight', [0.25, 0.35, -0.1], 'semidefinite'),
    ('mpc.torque_weight', [2.0, 2.0, 0.0], 'positive definite'),
    ('mpc.terminal_scale', 0.0, 'above 0 and below 1'),
    ('mpc.terminal_scale', 1.0, 'above 0 and below 1'),
    ('mpc.terminal_scale', NAN, 'a number'),
    ('mpc.horizon', 0, 'at least 1'),
    ('mpc.horizon', 30.0, 'an integer'),
    ('mpc.step_s', 0.0, 'above 0'),
    ('mpc.step_s', 'fast', 'a number'),
    ('limits.max_torque_n_m', [0.3, 0.3, 0.0], 'positive'),
    ('limits.max_rate_rad_s', [2.0, 2.0, 2.0], '1.5 rad'),
    ('limits.max_rate_rad_s', [0.8, 0.8, 0.8], 'smallest moment of inertia'),
    ('mpc.forcing', 'explicit', "'symmetric', 'paper'"),
    ('mpc.terminal_constraint', 1, 'true or false'),
    ('mpc.horizont', 30, "'mpc.horizon'"),
    ('state_source', 'gyro', "'odometry', 'astrobee'"),
    ('state_source', 'px4', 'px4_msgs/msg/VehicleAttitude to be a type of an installed package '
     '(the branch of your PX4 release of https://github.com/PX4/px4_msgs'),
    ('command_sink', 'astrobee', 'ff_msgs/msg/FamCommand to be a type of an installed package'),
    ('setpoint_source', 'imu', "a description with the key 'setpoint'"),
    ('body_frame_id', '', 'not empty'),
    ('use_sim_time_', True, 'unknown key'),
]
SIMULATOR: list[tuple[str, Any, str]] = [
    (INERTIA, [1.0, 0.3, 0.6], 'J_1 + J_2 > J_3'),
    ('limits.max_torque_n_m', None, 'missing'),
    ('plant.initial_attitude_xyzw', [0.0, 0.0, 2.0, 0.0], 'unit quaternion'),
    ('plant.initial_rate_rad_s', [0.0, 0.0], '3 numbers'),
    ('plant.step_s', 0.0, 'above 0'),
    ('sensor.rate_noise_std_rad_s', -1.0, 'at least 0'),
    ('sensor.seed', 1.5, 'an integer'),
    ('timing.state_period_s', 0.06, 'multiple of the plant step'),
    ('timing.real_time_factor', 20.0, 'publish_clock'),
    ('timing.realtime_factor', 20.0, "'timing.real_time_factor'"),
]


@pytest.fixture
def domain() -> Iterator[int]:
    """Give a domain that nobody else uses; leave ROS as it was found."""
    with reserved_domain() as number:
        yield number
        rclpy.try_shutdown()


@pytest.mark.parametrize(('program', 'key', 'value', 'valid'), [
    *(('controller', *case) for case in CONTROLLER),
    *(('simulator', *case) for case in SIMULATOR),
])
def test_refuses_with_one_message(
    domain: int, tmp_path: Path, capfd: pytest.CaptureFixture[str], program: str, key: str,
    value: object, valid: str,
) -> None:
    file = file_with(tmp_path, program, {key: value})
    rclpy.init(args=['--ros-args', '--params-file', str(file)], domain_id=domain,
               signal_handler_options=SignalHandlerOptions.NO)
    node_class, description = PROGRAMS[program]
    node = node_class(description, complete=True)
    try:
        assert node.trigger_configure() == TransitionCallbackReturn.FAILURE
    finally:
        node.destroy_node()
    lines = [line for line in capfd.readouterr().err.splitlines() if '[INFO]' not in line]
    assert len(lines) == 1
    assert f'refusing to configure: {key}: ' in lines[0]
    assert valid in lines[0]


def test_required_keys_may_be_absent_without_a_parameter_file(domain: int) -> None:
    """The shipped values then stand in; with a file nothing is assumed about the spacecraft."""
    rclpy.init(args=['--ros-args', '-p', 'plant.step_s:=0.05'], domain_id=domain,
               signal_handler_options=SignalHandlerOptions.NO)
    node = LgviSimulatorNode(simulator.PROGRAM, complete=False)
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    described = node.describe_parameter('plant.step_s')
    assert '[s]' in described.description
    assert described.read_only
    assert described.floating_point_range[0].to_value == 3600.0
    node.destroy_node()
