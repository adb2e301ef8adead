# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the processes end: on signals with zero torque last, on mistakes with one message."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from geometry_msgs.msg import WrenchStamped
from harness import file_with, log_line, stamp_ns, torque_of
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import GetState
from own_time import LONGEST_END_S, seconds_to_end
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

if TYPE_CHECKING:
    from harness import Process, Rig

SIGNALS = [signal.SIGINT, signal.SIGTERM]


@pytest.mark.parametrize('number', SIGNALS)
def test_signals_end_both_within_a_second_with_zero_torque_last(
    rig: Rig, number: signal.Signals,
) -> None:
    torques = rig.watch(WrenchStamped, 'torque_command')
    controller = rig.start('controller')
    simulator = rig.start('simulator')
    rig.until(lambda: bool(torques) and any(torque_of(torques[-1])), 'torque')
    assert seconds_to_end(controller, number) < LONGEST_END_S
    rig.until(lambda: len(torques) > 3 and not any(torque_of(torques[-1])), 'zero torque',
              alive=False)
    rig.settle()
    last = [torque_of(message) for message in torques[-4:]]
    assert any(last[0])
    assert last[1:] == [(0.0, 0.0, 0.0)] * 3
    assert len({stamp_ns(message) for message in torques[-4:]}) == 1
    assert seconds_to_end(simulator, number) < LONGEST_END_S


@pytest.mark.parametrize('number', SIGNALS)
def test_signals_end_a_controller_that_is_still_building_its_solver(
    rig: Rig, tmp_path: Path, number: signal.Signals,
) -> None:
    """An empty cache makes configuring take seconds; ending does not wait for it."""
    controller = rig.start('controller', MANIFOLD_MPC_CACHE=str(tmp_path / 'cache'))
    rig.until(log_line(controller, 'configuring'), 'configuring')
    assert seconds_to_end(controller, number) < 2.0 * LONGEST_END_S
    assert 'active' not in controller.log


def check_refusal(process: Process, key: str, valid: str) -> None:
    """Demand exit status 1 and one line that names the key and what is valid."""
    assert process.wait() == 1, process.log
    lines = [line for line in process.log.splitlines() if '[INFO]' not in line]
    assert len(lines) == 1, process.log
    assert f'{key}: ' in lines[0]
    assert valid in lines[0]


def test_a_controller_with_a_mistake_says_so_once_and_ends(rig: Rig, tmp_path: Path) -> None:
    file = file_with(tmp_path, 'controller', {'spacecraft.inertia_kg_m2': [1.0, 0.3, 0.6]})
    check_refusal(
        rig.start('controller', file=file), 'spacecraft.inertia_kg_m2', 'J_1 + J_2 > J_3')


def test_a_simulator_with_a_mistake_says_so_once_and_ends(rig: Rig) -> None:
    process = rig.start('simulator', parameters={'timing.real_time_factor': 20.0})
    check_refusal(process, 'timing.real_time_factor', 'publish_clock')


def test_a_file_that_ros_cannot_read_is_one_message_too(rig: Rig, tmp_path: Path) -> None:
    file = tmp_path / 'broken.yaml'
    file.write_text('attitude_controller: {ros__parameters: {a: [1, 0.5]}}', encoding='utf-8')
    process = rig.start('controller', file=file)
    assert process.wait() == 1
    assert len(process.log.splitlines()) == 1
    assert 'one type' in process.log


def test_configure_fails_and_succeeds_once_the_parameter_is_right(rig: Rig) -> None:
    node = '/attitude_controller'
    process = rig.start('controller', parameters={
        'autostart': False, 'limits.max_rate_rad_s': [5.0, 0.6, 0.6]})
    assert not rig.transition(node, Transition.TRANSITION_CONFIGURE)
    state = rig.call(GetState, f'{node}/get_state', GetState.Request()).current_state
    assert state.id == State.PRIMARY_STATE_UNCONFIGURED

    def put(name: str, value: object) -> tuple[bool, str]:
        parameter = Parameter(name, value=value).to_parameter_msg()
        result, = rig.call(SetParameters, f'{node}/set_parameters',
                           SetParameters.Request(parameters=[parameter])).results
        return result.successful, result.reason

    accepted, reason = put('limits.max_rate_rad_s', 'fast')
    assert not accepted
    assert 'limits.max_rate_rad_s' in reason
    assert put('limits.max_rate_rad_s', [0.6, 0.6, 0.6]) == (True, '')
    rig.activate(node)
    assert not put('mpc.step_s', 0.25)[0]  # fixed once it is configured
    assert not rig.transition(node, Transition.TRANSITION_CONFIGURE)  # it is active already
    accepted, reason = put('use_sim_time', True)
    assert not accepted
    assert 'deactivate' in reason
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP):
        assert rig.transition(node, transition)
    assert put('limits.max_rate_rad_s', [0.5, 0.5, 0.5]) == (True, '')
    rig.activate(node)
    assert process.running
