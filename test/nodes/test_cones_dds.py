# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cones over DDS: gone round, at every state; a direction comes by topic, bad ones are counted."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from test_pointing_dds import direction_message
from watching import attitude, error_rad, values_of

from manifold_mpc_ros.config.cones import Cone

if TYPE_CHECKING:
    from harness import Rig

# The telescope's axis x turns by 120 degrees about z: through the Sun, but for the cone.
SUN = (0.5, math.sqrt(0.75), 0.0)
CONTROLLER = {
    'lockstep': True, 'autostart': False, 'mpc.horizon': 40, 'limits.max_rate_rad_s': [0.2],
    'cones.names': ['sun'], 'cones.sun.axis_B': [1.0, 0.0, 0.0],
    'cones.sun.half_angle_deg': 20.0, 'cones.sun.direction_N': [0.0, 0.0, -1.0],
    'cones.sun.direction_topic': 'sun_direction'}
SIMULATOR = {'lockstep': True, 'autostart': False,
             'plant.initial_attitude_xyzw': [0.0, 0.0, math.sqrt(0.75), 0.5]}


# A start from which the telescope is 10 degrees inside the Sun's cone.
INSIDE_RAD = math.radians(70.0)
MOVES_RAD_S = 0.02
FAILING = '''
"""A controller whose solver fails while a file is there."""
from pathlib import Path
from manifold_mpc_ros.nodes.controller.main import PROGRAM
from manifold_mpc_ros.nodes.controller.node import AttitudeControllerNode

class Failing:
    def __init__(self, solver):
        self.solver = solver

    def __getattr__(self, name):
        return getattr(self.solver, name)

    def solve(self, *state, **budget):
        if Path('fail').exists():
            raise RuntimeError('no solver')
        return self.solver.solve(*state, **budget)

class FailingControllerNode(AttitudeControllerNode):
    def make_solver(self, config, terminal):
        return Failing(super().make_solver(config, terminal))

if __name__ == '__main__':
    from manifold_mpc_ros.nodes.process import run
    run(PROGRAM, 'failing:FailingControllerNode')
'''


def margins_rad(states: list[Odometry]) -> list[float]:
    """Return by which angle the telescope kept the cone about SUN at each state."""
    cone = Cone('sun', (1.0, 0.0, 0.0), SUN, math.radians(20.0))
    return [float(cone.margins_rad(attitude(each.pose.pose.orientation))) for each in states]


def start_inside(rig: Rig) -> None:
    rig.start('simulator', parameters=SIMULATOR | {'plant.initial_attitude_xyzw': [
        0.0, 0.0, math.sin(0.5 * INSIDE_RAD), math.cos(0.5 * INSIDE_RAD)]})


def test_a_cone_whose_direction_comes_by_topic_is_gone_round(rig: Rig) -> None:
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    publisher = rig.node.create_publisher(Vector3Stamped, 'sun_direction', 10)
    rig.start('controller', parameters=CONTROLLER)
    rig.start('simulator', parameters=SIMULATOR)
    rig.activate('/attitude_controller')

    def said(key: str) -> bool:
        return key in values_of(diagnostics, 'attitude_controller')

    rig.until(lambda: said('refused.sun_direction.zero_direction'), 'a refusal',
              meanwhile=lambda: publisher.publish(direction_message((0.0, 0.0, 0.0))))
    rig.tell(publisher, direction_message(SUN), lambda: values_of(
        diagnostics, 'attitude_controller').get('directions', '0') != '0', 'the direction')
    rig.activate('/lgvi_simulator')
    rig.until(lambda: bool(states) and error_rad(states[-1]) < 1e-3, 'the target',
              meanwhile=lambda: publisher.publish(direction_message(SUN)))
    margins = margins_rad(states)
    assert min(margins) > 0.0
    assert min(margins) < 0.2  # it was in the way
    there = np.degrees(margins[-1])

    def value(key: str) -> float:
        return float(values_of(diagnostics, 'attitude_controller').get(key, 'nan'))

    rig.until(lambda: abs(value('cone.sun.margin_deg') - there) < 1.0, 'the margin there')
    # Now it moves, at right angles to the telescope's axis and by the stamps of the states.
    told = [len(states)]

    def move() -> None:
        if len(states) > told[-1]:
            told.append(len(states))
            stamp = states[-1].header.stamp
            angle = MOVES_RAD_S * (stamp.sec + 1e-9 * stamp.nanosec)
            message = direction_message((0.0, math.cos(angle), math.sin(angle)))
            message.header.stamp = stamp
            publisher.publish(message)

    rig.until(lambda: abs(value('cone.sun.direction_rate_deg_s') - math.degrees(MOVES_RAD_S))
              < 1e-3, 'the rate of the Sun', meanwhile=move)
    rig.until(lambda: abs(value('cone.sun.margin_deg') - 70.0) < 0.1, 'its margin', meanwhile=move)


def test_a_start_inside_leaves_then_a_jump_and_a_setpoint_are_held_off(rig: Rig) -> None:
    """One flight: safe mode exit inside the cone, a stale direction, the Sun onto the target."""
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    sun = rig.node.create_publisher(Vector3Stamped, 'sun_direction', 10)
    rig.start('controller', parameters=CONTROLLER | {
        'cones.sun.direction_N': list(SUN), 'cones.sun.direction_timeout_s': 1.0})
    start_inside(rig)
    rig.activate('/attitude_controller')
    rig.activate('/lgvi_simulator')

    def value(key: str) -> str:
        return values_of(diagnostics, 'attitude_controller').get(key, '')

    def said(words: str) -> bool:
        return any(words in each.message for array in diagnostics for each in array.status)

    rig.until(lambda: bool(states) and error_rad(states[-1]) < 1e-3, 'the target')
    margins = margins_rad(states)
    outside = next(i for i, margin in enumerate(margins) if margin >= 0.0)
    assert margins[0] < -0.15
    assert 0 < outside < len(margins)
    assert min(margins[outside:]) >= 0.0  # left, and not entered again
    rig.until(lambda: said('no direction on sun_direction for'), 'the stale direction')
    assert float(value('cone.sun.direction_age_s')) > 1.0
    # The Sun moves onto the target: the body is inside at once, leaves, and stays out.
    before = len(states)
    onto = (math.cos(0.1), math.sin(0.1), 0.0)
    rig.until(lambda: said('the cone sun forbids the setpoint, which is held off'), 'held off',
              meanwhile=lambda: sun.publish(direction_message(onto)))
    missing = -float(value('cone.sun.target_margin_deg'))  # the tightened cone's, some wider
    assert 20.0 - math.degrees(0.1) < missing < 23.0 - math.degrees(0.1)
    cone = Cone('sun', (1.0, 0.0, 0.0), onto, math.radians(20.0))

    def margin() -> float:
        return float(cone.margins_rad(attitude(states[-1].pose.pose.orientation)))

    rig.until(lambda: len(states) > before and margin() >= 0.0, 'a body outside')
    reached = len(states)
    rig.until(lambda: len(states) > reached + 40, 'more states')
    held = [float(cone.margins_rad(attitude(each.pose.pose.orientation)))
            for each in states[reached:]]
    assert min(held) >= 0.0
    assert held[-1] < math.radians(4.0)  # as near as the cone lets it


def test_a_solver_that_fails_on_the_way_sweeps_no_sun_through_the_telescope(
    rig: Rig, tmp_path: Path,
) -> None:
    """HOLD, FALLBACK and back, while the telescope turns past the Sun."""
    (tmp_path / 'failing.py').write_text(FAILING, encoding='utf-8')
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    arguments = ['failing', '--ros-args']
    for name, value in (CONTROLLER | {'cones.sun.direction_N': list(SUN),
                                      'cones.sun.direction_topic': 'none'}).items():
        arguments += ['-p', f'{name}:={str(value).lower() if isinstance(value, bool) else value}']
    rig.run(arguments)
    rig.start('simulator', parameters=SIMULATOR)
    rig.activate('/attitude_controller')
    rig.activate('/lgvi_simulator')
    said: list[str] = []

    def mode() -> str:
        said.append(values_of(diagnostics, 'attitude_controller').get('mode', ''))
        return said[-1]

    rig.until(lambda: len(states) > 12, 'a turn to the Sun')
    (tmp_path / 'fail').touch()
    rig.until(lambda: mode() == 'FALLBACK', 'the fallback law')
    fell = len(states)
    rig.until(lambda: len(states) > fell + 30, 'more states')
    (tmp_path / 'fail').unlink()
    rig.until(lambda: mode() == 'NOMINAL' and error_rad(states[-1]) < 1e-3, 'the target')
    margins = margins_rad(states)
    assert min(margins) > 0.0
    assert min(margins) < 0.2  # it was in the way


def floats(name: str, *values: float) -> Parameter:
    return Parameter(name=name, value=ParameterValue(
        type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=values))


def double(name: str, value: float) -> Parameter:
    return Parameter(name=name, value=ParameterValue(
        type=ParameterType.PARAMETER_DOUBLE, double_value=value))


def test_cones_change_at_run_time_as_a_set_or_not_at_all(rig: Rig) -> None:
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    rig.start('controller', parameters=CONTROLLER | {'cones.sun.direction_topic': 'none'})
    rig.start('simulator', parameters=SIMULATOR)
    rig.activate('/attitude_controller')
    rig.activate('/lgvi_simulator')

    def value(key: str) -> str:
        return values_of(diagnostics, 'attitude_controller').get(key, '')

    def changed(*parameters: Parameter) -> str:
        """Return why a set is refused, empty when it is taken."""
        result = rig.call(
            SetParametersAtomically, '/attitude_controller/set_parameters_atomically',
            SetParametersAtomically.Request(parameters=list(parameters))).result
        assert result.successful == (result.reason == '')
        return str(result.reason)

    rig.until(lambda: bool(states) and error_rad(states[-1]) < 1e-3, 'the target')
    rig.until(lambda: abs(float(value('cone.sun.margin_deg')) - 70.0) < 0.5, 'the margin there')
    for reason, parameters in (
        ('cones.sun.axis_B', [floats('cones.sun.axis_B', 0.0, 0.0, 0.0)]),
        ('cones.sun.half_angle_deg', [double('cones.sun.half_angle_deg', 180.0)]),
        ('initial_setpoint', [floats('cones.sun.direction_N', 1.0, 0.0, 0.0)]),
        ('limits', [floats('limits.max_rate_rad_s', math.inf, math.inf, math.inf)]),
        # The first alone would do; together they are refused together.
        ('cones.sun.half_angle_deg', [floats('cones.sun.direction_N', 0.0, 1.0, 0.0),
                                      double('cones.sun.half_angle_deg', 0.0)]),
    ):
        said = changed(*parameters)
        assert reason in said
        assert '\n' not in said
    assert value('parameter_changes') == '0'
    assert changed(floats('cones.sun.direction_N', 0.0, 1.0, 0.0),
                   double('cones.sun.half_angle_deg', 40.0)) == ''
    rig.until(lambda: value('parameter_changes') == '1', 'the new cone')
    rig.until(lambda: abs(float(value('cone.sun.margin_deg')) - 50.0) < 0.5, 'its margin')
    assert value('mode') == 'NOMINAL'
