# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Verdicts: every limit is kept by a run that keeps it, and named when a run does not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from synthetic import (
    START_NS,
    diagnostics,
    header,
    make,
    quaternion,
    raw,
    run_messages,
    write_bag,
)

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.contents import RawMessage
from manifold_mpc_ros.lab.recording.bags.run import read_run
from manifold_mpc_ros.lab.recording.bags.verdict import RECORDING, Verdict, judge
from manifold_mpc_ros.lab.recording.scenarios.keys import ACCEPTANCE_KEYS

# The made-up run: 5 ticks, 180 deg and 0.1 rad less at each of them, rates to 0.04 rad/s, torques
# to 0.3 N m about z, all plans converged in 81.5 us, two states refused as stale.
KEPT: dict[str, Any] = {
    'attitude_tolerance_deg': 160.0, 'rate_tolerance_rad_s': 0.1, 'settle_time_s': 2.0,
    'final_error_deg': 157.1, 'final_rate_rad_s': 0.0401, 'peak_torque_n_m': [0.0, 0.0, 0.3],
    'peak_rate_rad_s': [0.0, 0.0, 0.04], 'violations': 0, 'cone_violation_s': 0.0,
    'solver_time_p99_ms': 0.0815, 'promises_broken': 1, 'infeasible_ticks': 0,
    'hold_ticks': 0, 'fallback_ticks': 0, 'coast_ticks': 0, 'refused_messages': 2}
# It turns about z, which stays where it is.
CONE: dict[str, Any] = {'limits': {'max_rate_rad_s': [0.2]}, 'cones': {
    'names': ['z'], 'z': {'axis_B': [0.0, 0.0, 1.0], 'direction_N': [0.0, 0.0, 1.0],
                          'half_angle_deg': 60.0, 'kind': 'keep_in'}}}
JUDGED = sorted(set(KEPT) - {'attitude_tolerance_deg', 'rate_tolerance_rad_s'})


def said(ticks: int, **values: str) -> RawMessage:
    """Return what the controller says at last."""
    return raw('/diagnostics', START_NS + 10**9, diagnostics(
        'attitude_controller', 0, 'solver: converged', {
            'mode': 'NOMINAL', 'ticks': str(ticks), 'solver_status': 'converged',
            'command_source': 'mpc', 'solve_time_us': '81.5', 'promises_broken': '1',
            'refused.odometry.stale': '2', 'refused.odometry.duplicate': '9', **values}))


def verdict(
    folder: Path, limits: dict[str, Any], messages: list[RawMessage] | None = None,
    duration_s: float = 2.0, controller: dict[str, Any] | None = None, **more: Any,
) -> Verdict:
    """Judge a made-up run by some limits."""
    scenario = yaml.safe_dump({'description': 'made up', 'duration_s': duration_s,
                               'controller': CONE if controller is None else controller,
                               'acceptance': limits})
    messages = messages or [*run_messages(5), said(5)]
    return judge(read_run(write_bag(folder / 'bag', messages, scenario=scenario, **more)))


def test_every_key_is_judged(tmp_path: Path) -> None:
    assert {spec.name for spec in ACCEPTANCE_KEYS} == set(KEPT)
    found = verdict(tmp_path, KEPT)
    assert [each.name for each in found.judgements] == [RECORDING, *(
        name for name in KEPT if name in JUDGED)]
    assert found.failed == ()
    assert found.passed


@pytest.mark.parametrize(('name', 'broken'), [
    ('settle_time_s', 1.5), ('final_error_deg', 157.0), ('final_rate_rad_s', 0.0399),
    ('peak_torque_n_m', [0.3, 0.3, 0.2999]), ('peak_rate_rad_s', [0.6, 0.6, 0.0399]),
    ('solver_time_p99_ms', 0.0814), ('promises_broken', 0), ('refused_messages', 1),
])
def test_a_limit_that_is_not_kept_is_named(tmp_path: Path, name: str, broken: Any) -> None:
    assert verdict(tmp_path, {**KEPT, name: broken}).failed == (name,)


@pytest.mark.parametrize(('name', 'values'), [
    ('infeasible_ticks', {'solver_status': 'infeasible'}),
    ('infeasible_ticks', {'solver_status': 'failed'}),
    ('hold_ticks', {'mode': 'HOLD'}), ('fallback_ticks', {'mode': 'FALLBACK'}),
    ('coast_ticks', {'mode': 'COAST'}),
])
def test_ticks_are_counted(tmp_path: Path, name: str, values: dict[str, str]) -> None:
    messages = [*run_messages(4), *run_messages(5)[-3:-1], said(5, **values)]
    assert verdict(tmp_path / 'none', KEPT, messages).failed == (name,)
    assert verdict(tmp_path / 'one', {**KEPT, name: 1}, messages).failed == ()


@pytest.mark.parametrize(('name', 'outcome'), [
    ('infeasible_ticks', 'complete'), ('fallback_ticks', 'complete'), ('coast_ticks', '')])
def test_the_count_of_the_controller_stands_for_ticks_that_it_did_not_speak_of(
        tmp_path: Path, name: str, outcome: str) -> None:
    """Ticks 2 to 4 of 5 are silent; a bag of somebody else may begin after some were counted."""
    for count in (0, 2):
        messages = [each for each in run_messages(5) if each.topic != '/diagnostics']
        messages += [said(1), said(5, **{name: str(count)})]
        found = verdict(tmp_path / str(count), {name: 1}, messages, custom={'outcome': outcome})
        assert found.judgements[-1].passed is bool(outcome and count <= 1)


def test_limits_of_the_controller_are_the_limits_of_violations(tmp_path: Path) -> None:
    weak = {'limits': {'max_torque_n_m': [0.3, 0.3, 0.285]}}
    found = verdict(tmp_path, {'violations': 1}, controller=weak)
    assert found.failed == ('violations',)  # 0.30 and 0.29 are beyond 0.285 * 1.01
    assert found.judgements[-1].measured == '2'


def setpoint(at_s: float) -> RawMessage:
    """Return a commanded half turn about z, which the made-up run leaves."""
    return raw('/attitude_setpoint', START_NS, make(
        'geometry_msgs/QuaternionStamped', header=header(10**9 + round(at_s * 1e9)),
        quaternion=quaternion(0.0, 0.0, 1.0, 0.0)))


def test_settling_is_judged_after_each_setpoint(tmp_path: Path) -> None:
    """Within 12 deg of the half turn at 0.5 to 1 s; a setpoint that is repeated counts once."""
    limits = {'attitude_tolerance_deg': 12.0, 'rate_tolerance_rad_s': 1.0, 'settle_time_s': 0.0}
    messages = [setpoint(0.0), setpoint(0.5), setpoint(0.5), *run_messages(3)]
    kept = verdict(tmp_path / 'kept', limits, messages, duration_s=1.0)
    assert kept.judgements[-1].measured == '0 s, 0 s'
    assert kept.passed
    messages = [setpoint(0.5), *run_messages(3)]
    late = verdict(tmp_path / 'late', limits, messages, duration_s=1.0)
    assert late.judgements[-1].measured == 'not settled, 0 s'
    assert late.failed == ('settle_time_s',)
    soon = verdict(tmp_path / 'soon', {**limits, 'settle_time_s': 0.6}, messages, duration_s=1.0)
    assert soon.judgements[-1].measured == 'superseded after 0.5 s, 0 s'
    assert soon.passed


def test_a_run_that_did_not_end_has_not_passed(tmp_path: Path) -> None:
    short = verdict(tmp_path / 'short', KEPT, duration_s=3.0)
    assert short.failed == (RECORDING,)
    assert 'ends at 2 s' in short.judgements[0].measured
    killed = verdict(tmp_path / 'killed', KEPT, custom={'outcome': 'interrupted'})
    assert killed.failed == (RECORDING,)
    assert killed.judgements[0].measured == 'interrupted'


def test_what_the_bag_does_not_say_is_not_kept(tmp_path: Path) -> None:
    scenario = yaml.safe_dump({'description': 'silent', 'duration_s': 2.0, 'controller': CONE,
                               'acceptance': KEPT})
    messages = [each for each in run_messages(5)
                if each.topic not in ('/diagnostics', '/torque_command')]
    found = judge(read_run(write_bag(tmp_path / 'bag', messages, scenario=scenario)))
    assert found.failed == (
        'peak_torque_n_m', 'solver_time_p99_ms', 'promises_broken', 'infeasible_ticks',
        'hold_ticks', 'fallback_ticks', 'coast_ticks', 'refused_messages')


def test_nothing_to_judge_by(tmp_path: Path) -> None:
    with pytest.raises(BagError, match='no acceptance limits'):
        verdict(tmp_path / 'no_limits', {})
    foreign = write_bag(tmp_path / 'foreign', run_messages(3), scenario='')
    with pytest.raises(BagError, match='no scenario that can be used'):
        judge(read_run(foreign))


@pytest.mark.parametrize(('speed', 'torque', 'beyond'), [
    ('400', '-0.5', 0), ('-406', '0.1', 1), ('10', '0.506', 1), ('410', '-0.51', 2),
])
def test_wheels_beyond_their_momentum_and_motor_torque_are_violations(
    tmp_path: Path, speed: str, torque: str, beyond: int,
) -> None:
    spoken = said(5, wheel_1_speed_rad_s=speed, wheel_1_torque_n_m=torque)
    found = verdict(tmp_path, {'violations': 0}, [*run_messages(5)[:-1], spoken],
                    controller={'actuators': {'kind': 'wheels'}})
    assert found.judgements[-1].measured == str(beyond)
