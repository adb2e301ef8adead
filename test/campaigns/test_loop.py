# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cases are functions of seed and name; a campaign counts what a controller breaks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import campaign_stubs as stubs
import numpy as np
import pytest
from strategies import INERTIAS

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.sim.campaign import (
    KINDS,
    OPPOSITE,
    RANDOM,
    CampaignSettings,
    CaseName,
    run_case,
    start_of,
)
from manifold_mpc_ros.sim.campaign_outcome import Outcome, decrease_excess, judge, target_angle
from manifold_mpc_ros.sim.campaign_summary import broken_cases, solve_times, summarise

SETTINGS = CampaignSettings(steps=40)
NAMES = [CaseName(RANDOM, 3), CaseName(RANDOM, 7), CaseName(OPPOSITE, 0), CaseName(OPPOSITE, 4)]


def config(**changed: Any) -> AttitudeMpcConfig:
    values: dict[str, Any] = {
        'inertia_kg_m2': INERTIAS['asymmetric'], 'step_s': 0.5, 'horizon': 8,
        'attitude_weight': (1, 1, 1), 'rate_weight': (0.25, 0.35, 0.65),
        'torque_weight': (2, 2, 2)}
    return AttitudeMpcConfig(**{**values, **changed})


def outcome_of(controller: Any, name: CaseName, settings: CampaignSettings = SETTINGS,
               **changed: Any) -> Outcome:
    return judge(run_case(controller, config(**changed), settings, name), config(**changed),
                 settings)


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    """Without limits the terminal set is nearly everything, and eight steps reach it."""
    return AttitudeMpc(config(), backend='vm')


@pytest.fixture(scope='module')
def outcomes(mpc: AttitudeMpc) -> list[Outcome]:
    return [outcome_of(mpc, name) for name in NAMES]


@pytest.mark.parametrize('kind', KINDS)
def test_a_start_depends_on_seed_and_name_alone(kind: str) -> None:
    R, omega = start_of(config(), SETTINGS, CaseName(kind, 17))
    again = start_of(config(), replace(SETTINGS, steps=3, settled_rad=1.0), CaseName(kind, 17))
    assert np.array_equal(R, again[0])
    assert np.array_equal(omega, again[1])
    for other in (start_of(config(), SETTINGS, CaseName(kind, 18)),
                  start_of(config(), replace(SETTINGS, seed=1), CaseName(kind, 17))):
        assert not np.allclose(R, other[0])


def test_random_starts_fill_attitudes_and_the_ball_of_rates() -> None:
    starts = [start_of(config(), SETTINGS, CaseName(RANDOM, k)) for k in range(2000)]
    R, omega = (np.array(part) for part in zip(*starts, strict=True))
    # A uniform attitude has mean 0 and E[angle] = pi/2 + 2/pi; a uniform ball E[r] = 3/4 R.
    assert np.abs(R.mean(axis=0)).max() < 0.05
    assert so3.angle(R).mean() == pytest.approx(np.pi / 2 + 2 / np.pi, abs=0.05)
    lengths = np.linalg.norm(omega, axis=1)
    assert lengths.max() <= 0.3
    assert lengths.mean() == pytest.approx(0.225, abs=0.005)
    assert np.abs(omega.mean(axis=0)).max() < 0.02


def test_opposite_starts_are_by_exactly_180_degrees_principal_axes_first() -> None:
    body = config(inertia_kg_m2=INERTIAS['off_diagonal'])
    for index in range(20):
        R, omega = start_of(body, SETTINGS, CaseName(OPPOSITE, index))
        assert so3.angle(R) == np.pi
        assert np.array_equal(omega, np.zeros(3))
        axis = so3.log(R) / np.pi
        principal = np.linalg.norm(np.cross(body.inertia_kg_m2 @ axis, axis)) < 1e-12
        assert principal == (index < 3)


def test_opposite_starts_of_pointing_are_antipodes_of_any_roll() -> None:
    body = config(target='pointing', pointing_axis_B=(0.6, 0.0, 0.8))
    b, rolls = body.pointing_axis_B, []
    for index in range(20):
        R, omega = start_of(body, SETTINGS, CaseName(OPPOSITE, index))
        assert np.allclose(R.T @ b, -b, rtol=0.0, atol=1e-15)
        assert target_angle(body, R[None])[0] == pytest.approx(np.pi, abs=1e-15)
        assert not omega.any()
        rolls.append(R[1] @ np.array([0.0, 1.0, 0.0]))
    assert np.ptp(rolls) > 1.0


@pytest.mark.parametrize('text', ['random-0', 'opposite-12'])
def test_names_read_back(text: str) -> None:
    assert str(CaseName.parse(text)) == text


@pytest.mark.parametrize(
    'text', ['', 'random', 'random-', 'random--1', 'other-1', '7', 'random-1x'])
def test_other_names_are_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match=f"case.*'{text}'"):
        CaseName.parse(text)


@pytest.mark.parametrize('rate', [-0.1, 1.2, 5.0, float('nan')])
def test_rates_without_a_step_are_refused(rate: float) -> None:
    """0.6 kg m^2 is the smallest moment: |h J w| < 0.6 for every direction needs |w| < 1.2."""
    with pytest.raises(ConfigurationError, match='largest rate'):
        replace(SETTINGS, largest_rate_rad_s=rate).check(config())
    replace(SETTINGS, largest_rate_rad_s=1.19).check(config())


def test_the_theory_holds_for_the_optimiser(outcomes: list[Outcome]) -> None:
    assert [outcome.broken for outcome in outcomes] == [()] * len(NAMES)
    for outcome in outcomes:
        assert outcome.settled_s is not None
        assert 0.0 < outcome.settled_s < 20.0
        assert outcome.largest_excess < 1e-9
        assert (outcome.infeasible, outcome.changes, outcome.decrease_violations) == (0, 0, 0)
        assert outcome.searches >= 1
        assert len(outcome.warm_solves_s) == SETTINGS.steps
    assert broken_cases(outcomes) == []


def test_a_case_does_not_depend_on_what_ran_before(
    mpc: AttitudeMpc, outcomes: list[Outcome],
) -> None:
    again = [outcome_of(mpc, name) for name in reversed(NAMES)]
    assert [o.record() for o in reversed(again)] == [o.record() for o in outcomes]


def test_a_first_torque_with_the_wrong_sign_is_one_violation(mpc: AttitudeMpc) -> None:
    for name in NAMES[:2]:
        outcome = outcome_of(stubs.FlippedFirst(mpc), name)
        assert outcome.broken == ('decrease',)
        assert outcome.decrease_violations == 1
        assert outcome.largest_excess > 1e-2
        assert outcome.settled_s is not None


def test_at_180_degrees_about_a_principal_axis_the_other_sign_is_as_good(
    mpc: AttitudeMpc,
) -> None:
    outcome = outcome_of(stubs.FlippedFirst(mpc), CaseName(OPPOSITE, 0))
    assert outcome.broken == ()
    assert outcome.changes == 1


def test_a_body_of_another_inertia_breaks_the_decrease(mpc: AttitudeMpc) -> None:
    outcome = outcome_of(mpc, NAMES[0], inertia_kg_m2=INERTIAS['asymmetric'] * 1.3)
    assert 'decrease' in outcome.broken
    assert outcome.decrease_violations > 3


def test_a_turn_that_changes_at_every_tick_chatters() -> None:
    outcome = outcome_of(stubs.Undecided(), CaseName(OPPOSITE, 5))
    assert outcome.changes == SETTINGS.steps
    assert {'chatter', 'not settled'} <= set(outcome.broken)
    assert outcome.settled_s is None


def test_limits_and_values_that_are_not_numbers_are_found() -> None:
    class Silent(stubs.Damping):
        def solve(self, R_NB: np.ndarray, omega_BN_B: np.ndarray) -> stubs.Answer:
            return replace(super().solve(R_NB, omega_BN_B), cost=float('nan'), status='feasible')
    outcome = outcome_of(Silent(), NAMES[0], max_torque_n_m=0.3, max_rate_rad_s=0.1)
    assert outcome.decrease_violations == SETTINGS.steps
    assert outcome.limits_exceeded > 2
    assert outcome.not_converged == SETTINGS.steps + 1
    assert {'decrease', 'limit exceeded'} <= set(outcome.broken)


def test_a_rate_beyond_its_limit_counts_only_after_a_plan_that_promised_it() -> None:
    class Outside(stubs.Damping):
        def solve(self, R_NB: np.ndarray, omega_BN_B: np.ndarray) -> stubs.Answer:
            answer = super().solve(R_NB, omega_BN_B)
            answer.status = 'infeasible' if np.abs(omega_BN_B).max() > 0.1 else 'converged'
            answer.torque_B_n_m *= 0.0
            return answer
    name = next(CaseName(RANDOM, k) for k in range(99) if np.abs(start_of(
        config(), SETTINGS, CaseName(RANDOM, k))[1]).min() > 0.11)
    outcome = outcome_of(Outside(), name, max_rate_rad_s=0.1)
    assert outcome.infeasible > 1
    assert outcome.limits_exceeded == outcome.feasibility_lost


def test_a_body_without_a_next_step_ends_the_loop() -> None:
    outcome = outcome_of(stubs.Damping(gain=50.0), NAMES[0])
    assert outcome.lost
    assert outcome.settled_s is None
    assert {'lost', 'not settled'} <= set(outcome.broken)
    assert len(outcome.warm_solves_s) < SETTINGS.steps


def test_settled_means_to_the_end() -> None:
    wide = replace(SETTINGS, settled_rad=0.3, settled_rad_s=0.3)
    course = run_case(stubs.Damping(), config(), wide, NAMES[0])
    outcome = judge(course, config(), wide)
    assert outcome.settled_s is not None
    k = round(outcome.settled_s / 0.5)
    error, rate = so3.angle(course.R_NB), np.linalg.norm(course.omega_BN_B, axis=1)
    assert np.all((error[k:] < 0.3) & (rate[k:] < 0.3))
    assert error[k - 1] >= 0.3 or rate[k - 1] >= 0.3


def test_the_summary_counts(mpc: AttitudeMpc, outcomes: list[Outcome]) -> None:
    flipped = outcome_of(stubs.FlippedFirst(mpc), NAMES[0])
    undecided = outcome_of(stubs.Undecided(), CaseName(OPPOSITE, 5))
    figures = summarise([*outcomes, flipped, undecided], config())
    assert (figures['loops'], figures['settled'], figures['broken_loops']) == (6, 5, 2)
    assert figures['chattering_loops'] == 1
    assert figures['loops_with_turn_changes'] == {'0': 4, '1': 1, '40': 1}
    assert flipped.changes == 1
    assert figures['decrease_violations'] == 1 + undecided.decrease_violations
    assert figures['settling_s']['max'] == max(o.settled_s for o in outcomes if o.settled_s)
    assert sum(figures['settling_histogram']['loops']) == 5
    assert figures['solves'] == 6 * 41
    assert [record['name'] for record in broken_cases([*outcomes, flipped])] == [flipped.name]
    times = solve_times([undecided])
    assert times == {'cold_us_median': 1000.0, 'cold_us_p99': 1000.0, 'warm_us_median': 1000.0,
                     'warm_us_p99': 1000.0}


def test_the_excess_is_relative_to_the_promise(mpc: AttitudeMpc) -> None:
    course = run_case(mpc, config(), SETTINGS, NAMES[0])
    raised = course.value.copy()
    before = decrease_excess(course, config())
    raised[5] += 0.01
    found = decrease_excess(replace(course, value=raised), config())
    # V(4) - L(4) is V(5), as the plan is carried on; a higher V(5) also promises less of V(6).
    assert found[4] - before[4] == pytest.approx(0.01 / (course.value[5] + 1e-3), rel=0.02)
    assert found[5] < before[5]
    assert np.array_equal(np.delete(found, [4, 5]), np.delete(before, [4, 5]))
