# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cases, the courses taken from them and how they are judged, by laws that hold and do not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import campaign_stubs as stubs
import numpy as np
import pytest
from campaign_plans import plan, plants

from manifold_mpc_ros.lab.campaign.case import CaseName, draw_case
from manifold_mpc_ros.lab.campaign.chunks import ChunkRunner, Work, build_controller
from manifold_mpc_ros.lab.campaign.loop import run_case
from manifold_mpc_ros.lab.campaign.outcome import Outcome, decrease_excess, judge, outcome_of
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.campaign.summary import broken_cases, solve_times, summarise
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

Array = np.ndarray

RANDOM, OPPOSITE = 'random', 'opposite'
NAMES = [CaseName(RANDOM, 3), CaseName(RANDOM, 7), CaseName(OPPOSITE, 0), CaseName(OPPOSITE, 4)]


def of(controller: Any, name: CaseName, **controller_changes: Any) -> Outcome:
    return outcome_of(controller, changed(**controller_changes), name)


def changed(**controller_changes: Any) -> CampaignPlan:
    """The small campaign with other controller parameters, ``__`` for the dot in their names."""
    return plan(controller={
        name.replace('__', '.'): value for name, value in controller_changes.items()})


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(plan().config)


@pytest.fixture(scope='module')
def outcomes(mpc: AttitudeMpc) -> list[Outcome]:
    return [of(mpc, name) for name in NAMES]


def test_the_theory_holds_for_the_optimiser(outcomes: list[Outcome]) -> None:
    assert [outcome.broken for outcome in outcomes] == [()] * len(NAMES)
    for outcome in outcomes:
        assert outcome.settled_s is not None
        assert 0.0 < outcome.settled_s < 20.0
        assert outcome.largest_excess < 1e-9
        assert (outcome.infeasible, outcome.changes, outcome.decrease_violations) == (0, 0, 0)
        assert outcome.searches >= 1
        assert len(outcome.warm_solves_s) == plan().steps
    assert broken_cases(outcomes) == []


def test_a_case_does_not_depend_on_what_ran_before(
    mpc: AttitudeMpc, outcomes: list[Outcome],
) -> None:
    again = [of(mpc, name) for name in reversed(NAMES)]
    assert [o.record() for o in reversed(again)] == [o.record() for o in outcomes]


def test_a_first_torque_with_the_wrong_sign_is_one_violation(mpc: AttitudeMpc) -> None:
    for name in NAMES[:2]:
        outcome = of(stubs.FlippedFirst(mpc), name)
        assert outcome.broken == ('decrease',)
        assert outcome.decrease_violations == 1
        assert outcome.largest_excess > 1e-2
        assert outcome.settled_s is not None


def test_at_180_degrees_about_a_principal_axis_the_other_sign_is_as_good(
    mpc: AttitudeMpc,
) -> None:
    outcome = of(stubs.FlippedFirst(mpc), CaseName(OPPOSITE, 0))
    assert outcome.broken == ()
    assert outcome.changes == 1


def test_a_body_of_another_inertia_breaks_the_decrease(mpc: AttitudeMpc) -> None:
    outcome = of(mpc, NAMES[0], spacecraft__inertia_kg_m2=[1.3, 1.17, 0.78])
    assert 'decrease' in outcome.broken
    assert outcome.decrease_violations > 3


def test_a_turn_that_changes_at_every_tick_chatters() -> None:
    outcome = of(stubs.Undecided(), CaseName(OPPOSITE, 5))
    assert outcome.changes == plan().steps
    assert {'chatter', 'not settled'} <= set(outcome.broken)
    assert outcome.settled_s is None


def test_limits_and_values_that_are_not_numbers_are_found() -> None:
    class Silent(stubs.Damping):
        def solve(self, R_NB: Array, omega_BN_B: Array, R_ND: Array) -> stubs.Answer:
            return replace(super().solve(R_NB, omega_BN_B, R_ND), cost=float('nan'),
                           status='feasible')
    outcome = of(Silent(), NAMES[0], limits__max_torque_n_m=[0.3], limits__max_rate_rad_s=[0.1])
    assert outcome.decrease_violations == plan().steps
    assert outcome.limits_exceeded > 2
    assert outcome.not_converged == plan().steps + 1
    assert {'decrease', 'limit exceeded'} <= set(outcome.broken)


def test_a_rate_beyond_its_limit_counts_only_after_a_plan_that_promised_it() -> None:
    class Outside(stubs.Damping):
        def solve(self, R_NB: Array, omega_BN_B: Array, R_ND: Array) -> stubs.Answer:
            answer = super().solve(R_NB, omega_BN_B, R_ND)
            answer.status = 'infeasible' if np.abs(omega_BN_B).max() > 0.1 else 'converged'
            answer.torque_B_n_m *= 0.0
            return answer
    name = next(CaseName(RANDOM, k) for k in range(99) if np.abs(draw_case(
        plan(), CaseName(RANDOM, k)).omega_BN_B).min() > 0.11)
    outcome = of(Outside(), name, limits__max_rate_rad_s=[0.1])
    assert outcome.infeasible > 1
    assert outcome.limits_exceeded == outcome.feasibility_lost


def test_a_body_without_a_next_step_ends_the_loop() -> None:
    outcome = of(stubs.Damping(gain=50.0), NAMES[0])
    assert outcome.lost
    assert outcome.settled_s is None
    assert {'lost', 'not settled'} <= set(outcome.broken)
    assert len(outcome.warm_solves_s) < plan().steps


def test_settled_means_to_the_end() -> None:
    wide = plan(acceptance={'attitude_tolerance_deg': np.degrees(0.3).item(),
                            'rate_tolerance_rad_s': 0.3})
    course = run_case(stubs.Damping(), wide, draw_case(wide, NAMES[0]))
    outcome = judge(course, wide)
    assert outcome.settled_s is not None
    k = round(outcome.settled_s / 0.5)
    error, rate = so3.angle(course.R_NB), np.linalg.norm(course.omega_BN_B, axis=1)
    assert np.all((error[k:] < 0.3) & (rate[k:] < 0.3))
    assert error[k - 1] >= 0.3 or rate[k - 1] >= 0.3


def test_the_summary_counts(mpc: AttitudeMpc, outcomes: list[Outcome]) -> None:
    flipped = of(stubs.FlippedFirst(mpc), NAMES[0])
    undecided = of(stubs.Undecided(), CaseName(OPPOSITE, 5))
    figures = summarise([*outcomes, flipped, undecided], plan().config)
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
    course = run_case(mpc, plan(), draw_case(plan(), NAMES[0]))
    raised = course.value.copy()
    before = decrease_excess(course, plan().config)
    raised[5] += 0.01
    found = decrease_excess(replace(course, value=raised), plan().config)
    # V(4) - L(4) is V(5), as the plan is carried on; a higher V(5) also promises less of V(6).
    assert found[4] - before[4] == pytest.approx(0.01 / (course.value[5] + 1e-3), rel=0.02)
    assert found[5] < before[5]
    assert np.array_equal(np.delete(found, [4, 5]), np.delete(before, [4, 5]))


def test_the_commanded_attitude_does_not_matter_but_for_rounding(mpc: AttitudeMpc) -> None:
    """The problem is invariant: the same error and rate give the same loop."""
    one = {'name': 'some', 'loops': 1, 'attitude': {'kind': 'uniform'},
           'rate': {'kind': 'ball', 'largest_rad_s': 0.3}}
    name = CaseName('some', 5)
    here = outcome_of(mpc, plan(one), name)
    there = outcome_of(mpc, plan({**one, 'setpoint': {'kind': 'uniform'}}), name)
    assert there.setpoint_xyzw != here.setpoint_xyzw
    assert there.broken == here.broken == ()
    assert (there.settled_s, there.changes) == (here.settled_s, here.changes)
    assert there.initial_angle_deg == pytest.approx(here.initial_angle_deg)
    assert there.largest_torque_n_m == pytest.approx(here.largest_torque_n_m, abs=1e-6)


def test_a_plant_without_any_spread_settles_as_the_model_does(mpc: AttitudeMpc) -> None:
    quiet = plants(inertia={}, disturbance={'largest_n_m': 0.0}, noise={},
                   setpoint={'kind': 'identity'})
    on_plant = outcome_of(mpc, plan(quiet), CaseName('plants', 2))
    model = {key: value for key, value in {**quiet, 'body': 'model'}.items()
             if key not in ('inertia', 'disturbance', 'noise')}
    on_model = outcome_of(mpc, plan(model), CaseName('plants', 2))
    assert on_plant.initial_attitude_xyzw == on_model.initial_attitude_xyzw
    assert on_plant.settled_s == pytest.approx(on_model.settled_s, abs=1.0)
    assert on_plant.inertia_kg_m2 == pytest.approx(on_model.inertia_kg_m2)


def test_a_plant_feels_what_its_case_drew(mpc: AttitudeMpc) -> None:
    """A constant torque about x leaves an error that grows with it; noise leaves some too."""
    def final(**changed: Any) -> float:
        parts = {'inertia': {}, 'disturbance': {'largest_n_m': 0.0}, 'noise': {}, **changed}
        return outcome_of(mpc, plan(plants(**parts)), CaseName('plants', 1)).final_angle_deg
    quiet = final()
    small, large = (final(disturbance={'largest_n_m': torque}) for torque in (1e-3, 1e-2))
    assert quiet < 1e-3 < 100 * quiet < small
    assert 5.0 < large / small < 20.0
    assert final(noise={'attitude_std_rad': 1e-3}) > 100 * quiet


def test_every_limit_of_the_acceptance_can_break(mpc: AttitudeMpc) -> None:
    name = CaseName('plants', 0)
    strict = plan(plants(acceptance={
        'settle_time_s': 0.5, 'final_error_deg': 1e-9, 'final_rate_rad_s': 1e-12,
        'peak_rate_rad_s': 1e-3, 'promises_broken': 0}))
    assert set(outcome_of(mpc, strict, name).broken) >= {
        'settled late', 'final error', 'final rate', 'peak rate', 'decrease'}
    loose = plan(plants(acceptance={
        'settle_time_s': 20.0, 'final_error_deg': 90.0, 'final_rate_rad_s': 1.0,
        'peak_rate_rad_s': [3.0, 3.0, 3.0], 'promises_broken': 99}))
    assert outcome_of(mpc, loose, name).broken == ()


def test_cones_in_the_way_are_kept_by_the_optimiser_and_broken_by_a_law_that_knows_none() -> None:
    one = {'name': 'some', 'loops': 3, 'attitude': {'kind': 'angle', 'angle_deg': [90.0, 120.0]},
           'rate': {'kind': 'rest'}, 'cones': {'most': 1, 'on_the_way': True},
           'acceptance': {'cone_violation_s': 0.0}}
    small = plan(one, controller={'mpc.horizon': 40, 'limits.max_torque_n_m': [0.3] * 3,
                                  'limits.max_rate_rad_s': [0.3] * 3})
    kept, broken = (ChunkRunner(Work(small, make)).run([CaseName('some', 1)])[0]
                    for make in (build_controller, stubs.make_damping))
    for outcome in (kept, broken):
        assert (outcome.cones, outcome.way_crosses_a_cone) == (1, True)
    assert kept.broken == ()
    assert (kept.cone_violations, kept.cone_violation_s) == (0, 0.0)
    assert kept.least_cone_margin_deg is not None
    assert kept.least_cone_margin_deg >= 0.0
    assert 'cone violated' in broken.broken
    assert broken.cone_violation_s >= 0.5 * broken.cone_violations > 0.0


def test_a_plant_that_cannot_be_advanced_is_lost() -> None:
    wild = plants(rate={'kind': 'fixed', 'rad_s': [1e5, 0.0, 0.0]})
    outcome = outcome_of(stubs.Damping(), plan(wild), CaseName('plants', 0))
    assert outcome.lost
    assert outcome.broken[:2] == ('lost', 'not settled')
