# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The promise on /diagnostics: kept by the nominal body over DDS, and the warning by another."""

from __future__ import annotations

import itertools
import math
import re
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import QuaternionStamped
from nav_msgs.msg import Odometry
from std_srvs.srv import SetBool, Trigger
from watching import is_settled, values_of

if TYPE_CHECKING:
    from harness import Process, Rig

NODE = 'attitude_controller'
BY_HAND = {'lockstep': True, 'autostart': False}
INERTIA = (1.0, 0.9, 0.6)
#: At rest the value function is of this size, and of either sign.
ROUNDING = 1e-15
CAUSE = 'a disturbance, a torque that came late, or a plant that differs from the model'


def start(rig: Rig, plant: dict[str, Any] | None = None, **controller: Any) -> Process:
    """Start both nodes in lockstep; return the controller."""
    process = rig.start('controller', parameters=BY_HAND | controller)
    rig.start('simulator', parameters=BY_HAND | (plant or {}))
    rig.activate('/attitude_controller')
    rig.activate('/lgvi_simulator')
    return process


def by_tick(diagnostics: list[DiagnosticArray]) -> dict[int, tuple[bytes, str, dict[str, str]]]:
    """Return level, message and values of what the controller first said of each tick."""
    found: dict[int, tuple[bytes, str, dict[str, str]]] = {}
    for array in diagnostics:
        for status in array.status:
            values = {pair.key: pair.value for pair in status.values}
            if status.name == NODE and int(values.get('ticks', '0')) > 0:
                found.setdefault(int(values['ticks']), (status.level, status.message, values))
    return found


def count(diagnostics: list[DiagnosticArray], key: str) -> int:
    """Return the latest value of a counter."""
    return int(values_of(diagnostics, NODE).get(key, '0'))


def test_the_nominal_body_keeps_every_promise_to_the_end(rig: Rig) -> None:
    """From exactly 180 degrees; every tick is on /diagnostics, not only the latest."""
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    process = start(rig)
    rig.until(lambda: is_settled(states) and count(diagnostics, 'ticks') > 60, 'rest')
    ticks = by_tick(diagnostics)
    assert sorted(ticks) == list(range(1, max(ticks) + 1))
    _, _, first = ticks[1]
    assert (first['promise'], first['promised_value']) == ('none (first tick)', 'nan')
    assert (first['in_domain_of_attraction'], first['in_terminal_set']) == ('true', 'false')
    for tick, (level, message, values) in ticks.items():
        assert (level, message) == (DiagnosticStatus.OK, 'solver: converged')
        assert values['promises_broken'] == values['ticks_outside_domain'] == '0'
        assert int(values['promises_checked']) == tick - 1
        if tick > 1:
            assert values['promise'] == 'kept'
            excess = float(values['value_function']) - float(values['promised_value'])
            assert float(values['decrease_excess']) == pytest.approx(
                excess, abs=1e-4 * max(ROUNDING, float(values['value_function'])))
    assert ticks[max(ticks)][2]['in_terminal_set'] == 'true'
    assert not re.search(r'tick \d+: ', process.log)


@pytest.mark.parametrize('plant', [
    {'plant.disturbance_torque_n_m': [0.02, -0.01, 0.01]},
    {'spacecraft.inertia_kg_m2': [1.2 * moment for moment in INERTIA]},
    {'spacecraft.inertia_kg_m2': [1.5 * moment for moment in INERTIA]},
    {'spacecraft.inertia_kg_m2': [0.5 * moment for moment in INERTIA]},
])
def test_another_body_is_warned_of(rig: Rig, plant: dict[str, Any]) -> None:
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    process = start(rig, plant)
    rig.until(lambda: count(diagnostics, 'ticks') > 30, 'thirty ticks')
    ticks = by_tick(diagnostics)
    rig.more(diagnostics, 5, 'further ticks')  # what is logged of these ticks is in the log
    broken = [tick for tick, (_, _, values) in ticks.items() if values['promise'] == 'broken']
    assert broken
    for number, tick in enumerate(broken, start=1):
        level, message, values = ticks[tick]
        assert level == DiagnosticStatus.WARN
        assert message.startswith('the value function ')
        assert message.endswith(CAUSE)
        assert int(values['promises_broken']) == number
        assert 0.1 < float(values['relative_excess']) <= float(values['largest_relative_excess'])
    assert {level for tick, (level, _, _) in ticks.items() if tick < broken[0]} == {
        DiagnosticStatus.OK}
    bursts = [broken[0], *(
        after for before, after in itertools.pairwise(broken) if after - before > 6)]
    logged = [int(tick) for tick in re.findall(r'tick (\d+): the value function ', process.log)]
    assert [tick for tick in logged if tick in ticks] == bursts


def test_the_warning_stays_for_five_ticks_and_ends(rig: Rig) -> None:
    """A heavy body breaks promises in the slew and keeps them at its end, near rest."""
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    start(rig, {'spacecraft.inertia_kg_m2': [1.2 * moment for moment in INERTIA]})
    rig.until(lambda: count(diagnostics, 'ticks') > 80, 'eighty ticks')
    ticks = by_tick(diagnostics)
    last = max(tick for tick, (_, _, values) in ticks.items() if values['promise'] == 'broken')
    for ago in range(1, 6):
        level, message, values = ticks[last + ago]
        assert (level, values['promise']) == (DiagnosticStatus.WARN, 'kept')
        assert message.startswith(f'{ago} tick{"s" if ago > 1 else ""} ago: the value function ')
    level, message, values = ticks[last + 6]
    assert (level, message) == (DiagnosticStatus.OK, 'solver: converged')
    assert int(values['promises_broken']) > 0


def test_what_the_operator_does_breaks_no_promise(rig: Rig) -> None:
    """A new setpoint, a pause and a reset: each ends one promise, and is named."""
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    reasons: set[str] = set()

    def seen(reason: str) -> bool:
        reasons.update(values['promise'] for _, _, values in by_tick(diagnostics).values())
        return f'none ({reason})' in reasons

    publisher = rig.node.create_publisher(QuaternionStamped, 'attitude_setpoint', 10)
    start(rig)
    setpoint = QuaternionStamped()
    setpoint.header.frame_id = 'inertial'
    setpoint.quaternion.x, setpoint.quaternion.w = math.sin(0.5), math.cos(0.5)
    rig.until(lambda: publisher.get_subscription_count() > 0, 'the controller')
    rig.until(lambda: seen('the setpoint changed'), 'a new setpoint',
              meanwhile=lambda: publisher.publish(setpoint))
    for paused in (True, False):
        assert rig.call(
            SetBool, '/attitude_controller/pause', SetBool.Request(data=paused)).success
        rig.until(lambda: seen('paused by the operator'), 'a pause')
    assert rig.call(Trigger, '/attitude_controller/reset', Trigger.Request()).success
    rig.until(lambda: seen('reset') or seen('comparing attitude and rate of the first states'),
              'a reset')
    assert count(diagnostics, 'promises_broken') == 0


def test_a_wider_tolerance_is_silent(rig: Rig) -> None:
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    start(rig, {'spacecraft.inertia_kg_m2': [1.2 * moment for moment in INERTIA]},
          **{'monitor.decrease_tolerance': 0.5})
    rig.until(lambda: count(diagnostics, 'ticks') > 30, 'thirty ticks')
    assert count(diagnostics, 'promises_broken') == 0
    assert max(float(values['relative_excess'])
               for tick, (_, _, values) in by_tick(diagnostics).items() if tick > 1) > 0.1


def test_a_state_outside_the_domain_of_attraction_is_a_warning_until_inside(rig: Rig) -> None:
    """Eight steps do not reach the terminal set from 180 degrees: WARN, then OK once they do."""
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    start(rig, **{'mpc.horizon': 8})
    rig.until(lambda: values_of(diagnostics, NODE).get('in_terminal_set') == 'true', 'the set')
    ticks = by_tick(diagnostics)
    level, message, values = ticks[1]
    assert level == DiagnosticStatus.WARN
    assert 'no plan keeps every limit and reaches the terminal set' in message
    assert values['in_domain_of_attraction'] == 'false'
    inside = [tick for tick in ticks if ticks[tick][2]['in_domain_of_attraction'] == 'true']
    assert inside
    assert all(ticks[tick][0] == DiagnosticStatus.OK for tick in inside)
    assert all(later in inside for later in ticks if later >= min(inside))
