# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What one closed loop of a campaign shows, and what it breaks: a row of the table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from manifold_mpc_ros.config.cones import between_samples, joined
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import rates_beyond
from manifold_mpc_ros.dynamics.inertia import free_steps_exist
from manifold_mpc_ros.lab.campaign import turning
from manifold_mpc_ros.lab.campaign.case import Case, CaseName, draw_case
from manifold_mpc_ros.lab.campaign.keys import MODEL, PLANT
from manifold_mpc_ros.lab.campaign.loop import Course, PlanningController, run_case
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.campaign.random_cones import straight_way
from manifold_mpc_ros.lab.campaign.sets import Limits
from manifold_mpc_ros.lab.closed_loop import settling_time
from manifold_mpc_ros.lab.reference.cone_history import ConeHistory, least_margins_rad
from manifold_mpc_ros.lab.reference.stage_cost import stage_costs
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import AnyArray as Array
from manifold_mpc_ros.mpc.target import error_angle

# The decrease is violated when V(k+1) > V(k) - L(k) by more than RELATIVE of it plus ABSOLUTE.
RELATIVE, ABSOLUTE = 1e-6, 1e-9
# A limit counts as exceeded beyond these parts of it. The solver keeps torques strictly inside and
# rates of its model within its tolerance; a plant is not the model, and may go a little beyond.
TORQUE_MARGIN, RATE_MARGIN = 1e-9, {MODEL: 1e-6, PLANT: 1e-2}


@dataclass(frozen=True)
class Outcome:
    """What one case drew and what came of it: a row of the table; units as the names say.

    ``changes`` counts changes of the side of the turn (for pointing: reversals of the direction);
    ``largest_excess`` is the largest ``V(k+1) - (V(k) - L(k))`` over ``|V(k) - L(k)| + 1e-3``, a
    violation when above RELATIVE. ``feasibility_lost`` counts infeasible ticks that follow a
    feasible one, ``limits_exceeded`` torques over their limit and rates over theirs where the
    plan before promised otherwise. ``cone_violations`` counts ticks that break a cone,
    ``cone_violation_s`` is the time in which one is not kept for sure, between ticks too, where
    ``least_cone_margin_deg`` is the least that is sure; ``way_crosses_a_cone`` says that turning
    straight to the commanded attitude would break one. ``broken`` names what was not to happen
    and did.
    """

    name: str
    initial_angle_deg: float
    initial_rate_rad_s: float
    settled_s: float | None
    final_angle_deg: float
    final_rate_rad_s: float
    changes: int
    decrease_violations: int
    largest_excess: float
    infeasible: int
    not_converged: int
    feasibility_lost: int
    limits_exceeded: int
    searches: int
    largest_torque_n_m: tuple[float, ...]
    largest_rate_rad_s: tuple[float, ...]
    roll_turned_deg: float | None
    cones: int
    way_crosses_a_cone: bool
    cone_violations: int
    cone_violation_s: float
    least_cone_margin_deg: float | None
    lost: bool
    broken: tuple[str, ...]
    initial_attitude_xyzw: tuple[float, ...]
    initial_rate_B_rad_s: tuple[float, ...]
    setpoint_xyzw: tuple[float, ...]
    inertia_kg_m2: tuple[float, ...]  # xx, yy, zz, xy, xz, yz
    disturbance_n_m: tuple[float, ...]
    attitude_noise_std_rad: float
    rate_noise_std_rad_s: float
    noise_seed: int
    cold_solve_s: float
    warm_solves_s: tuple[float, ...]

    def record(self) -> dict[str, Any]:
        """Return every figure but the solve times, which no two runs share."""
        return {key: value for key, value in vars(self).items() if key not in TIMES}


#: The figures of an outcome that are not the same in every run.
TIMES = ('cold_solve_s', 'warm_solves_s')


def outcome_of(controller: PlanningController, plan: CampaignPlan, name: CaseName) -> Outcome:
    """Map a case to its row: draw it, run it, judge it."""
    return judge(run_case(controller, plan, draw_case(plan, name)), plan)


def judge(course: Course, plan: CampaignPlan) -> Outcome:
    """Map a closed loop to its figures."""
    config, case = plan.config, course.case
    limits = case.drawn_from.acceptance
    angle, rate = error_angle(config, course.R_DB), np.linalg.norm(course.omega_BN_B, axis=1)
    below = (angle < np.radians(limits.attitude_tolerance_deg)) & (
        rate < limits.rate_tolerance_rad_s)
    settled_s = settling_time(config.step_s * np.arange(len(below)), below)
    excess = decrease_excess(course, config)
    infeasible = course.status == 'infeasible'
    pointing = config.target == 'pointing'
    found: dict[str, Any] = {
        'settled_s': None if course.lost else settled_s,
        'final_angle_deg': float(np.degrees(angle[-1])),
        'final_rate_rad_s': float(rate[-1]),
        'changes': count_turn_changes(course, config),
        'decrease_violations': int(np.count_nonzero(~(excess <= RELATIVE))),
        'infeasible': int(np.count_nonzero(infeasible)),
        'not_converged': int(np.count_nonzero(np.isin(course.status, ('feasible', 'failed')))),
        'feasibility_lost': int(np.count_nonzero(infeasible[1:] & ~infeasible[:-1])),
        'limits_exceeded': _exceeded(course, config),
        **_cones(course),
        'largest_rate_rad_s': tuple(np.abs(course.omega_BN_B).max(axis=0).tolist()),
        'lost': course.lost,
    }
    return Outcome(
        name=str(case.name), initial_angle_deg=float(np.degrees(angle[0])),
        initial_rate_rad_s=float(rate[0]), largest_excess=float(np.max(excess, initial=-np.inf)),
        searches=int(np.count_nonzero(course.searched)),
        largest_torque_n_m=tuple(np.abs(course.torque_B_n_m).max(axis=0).tolist()),
        roll_turned_deg=float(np.degrees(turning.roll_turned(
            config.pointing_axis_B, course.R_DB))) if pointing else None,
        broken=tuple(_broken(found, limits)), cold_solve_s=float(course.solve_time_s[0]),
        warm_solves_s=tuple(course.solve_time_s[1:].tolist()), **_drawn(case), **found)


def _drawn(case: Case) -> dict[str, Any]:
    """Return what a case drew, as figures."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = case.inertia_kg_m2.tolist()
    return {
        'initial_attitude_xyzw': _xyzw(case.R_NB),
        'initial_rate_B_rad_s': tuple(case.omega_BN_B.tolist()),
        'setpoint_xyzw': _xyzw(case.R_ND),
        'inertia_kg_m2': (xx, yy, zz, xy, xz, yz),
        'disturbance_n_m': tuple(case.disturbance_n_m.tolist()),
        'attitude_noise_std_rad': case.attitude_noise_std_rad,
        'rate_noise_std_rad_s': case.rate_noise_std_rad_s,
        'noise_seed': case.noise_seed,
    }


def _xyzw(R: Array) -> tuple[float, ...]:
    """Map R (3, 3) to its quaternion x, y, z, w."""
    w, x, y, z = so3.quaternion_from_rotation(R).tolist()
    return x, y, z, w


def decrease_excess(course: Course, config: AttitudeMpcConfig) -> Array:
    """Return ``(V(k+1) - (V(k) - L(k))) / (|V(k) - L(k)| + ABSOLUTE / RELATIVE)`` (n - 1,).

    V is the solver's, L is not. A value that is not finite gives one that is not, a violation.
    """
    bound = course.value[:-1] - stage_costs_of(course, config)[:-1]
    return (course.value[1:] - bound) / (np.abs(bound) + ABSOLUTE / RELATIVE)


def stage_costs_of(course: Course, config: AttitudeMpcConfig) -> Array:
    """Return L at each tick (n,); NaN where the state has no free step."""
    exists = free_steps_exist(course.omega_BN_B, config.inertia_kg_m2, config.step_s)
    costs = np.full(len(exists), np.nan)
    costs[exists] = stage_costs(config, course.R_DB[exists], course.omega_BN_B[exists],
                                course.torque_B_n_m[exists])
    return costs


def count_turn_changes(course: Course, config: AttitudeMpcConfig) -> int:
    """Return how often the side of the turn, for pointing its direction, changed."""
    if config.target == 'pointing':
        back = turning.reversals(config.pointing_axis_B, course.R_DB, course.plan_R_DB)
        return int(np.count_nonzero(back))
    return turning.count_changes(turning.sides_of_turn(course.R_DB, course.plan_R_DB))


def _exceeded(course: Course, config: AttitudeMpcConfig) -> int:
    """Return how many ticks exceed a limit; rates only where the plan before kept them."""
    count = 0
    if config.max_torque_n_m is not None:
        limit = config.max_torque_n_m * (1.0 + TORQUE_MARGIN)
        count += int(np.count_nonzero(np.any(np.abs(course.torque_B_n_m) > limit, axis=1)))
    over = rates_beyond(config.rate_limits, course.omega_BN_B[1:],
                        RATE_MARGIN[course.case.drawn_from.body])
    promised = np.isin(course.status[:-1], ('converged', 'feasible'))
    return count + int(np.count_nonzero(over & promised))


def _cones(course: Course) -> dict[str, Any]:
    """Return how the cones were kept, between the body's steps too."""
    cones, path, case = course.case.cones, course.path_R_NB, course.case
    found = {'cones': len(cones), 'way_crosses_a_cone': False, 'cone_violations': 0,
             'cone_violation_s': 0.0, 'least_cone_margin_deg': None}
    if not cones or len(path) < 2:
        return found
    J, disturbed = case.inertia_kg_m2, float(np.linalg.norm(case.disturbance_n_m))
    acceleration = np.linalg.norm(np.linalg.solve(J, course.torque_B_n_m.T), axis=0).max() \
        + disturbed / np.linalg.eigvalsh(J)[0]
    rate = np.linalg.norm(course.path_omega_BN_B, axis=1).max()
    between = [between_samples(J, float(acceleration), float(rate), course.path_step_s)]
    histories = [ConeHistory(cone, path @ cone.axis_B, np.tile(cone.direction_N, (len(path), 1)))
                 for cone in cones]
    straight, at_ticks, sure = (np.min(list(margins.values()), axis=0) for margins in (
        *(joined(cones, np.array([cone.margins_rad(R_NB) for cone in cones]))
          for R_NB in (straight_way(path[0], case.R_ND), course.R_NB)),
        least_margins_rad(histories, between * (len(path) - 1))))
    return found | {
        'way_crosses_a_cone': bool(straight.min() < 0.0),
        'cone_violations': int(np.count_nonzero(at_ticks < 0.0)),
        'cone_violation_s': course.path_step_s * int(np.count_nonzero(sure < 0.0)),
        'least_cone_margin_deg': float(np.degrees(sure.min()))}


def _broken(found: dict[str, Any], limits: Limits) -> list[str]:
    """Return the names of what was not to happen."""
    settled_s = found['settled_s']
    largest: list[tuple[str, str, float | None]] = [
        ('chatter', 'changes', limits.turn_changes),
        ('decrease', 'decrease_violations', limits.promises_broken),
        ('feasibility lost', 'feasibility_lost', limits.feasibility_lost),
        ('infeasible', 'infeasible', limits.infeasible_ticks),
        ('limit exceeded', 'limits_exceeded', limits.limits_exceeded),
        ('final error', 'final_angle_deg', limits.final_error_deg),
        ('final rate', 'final_rate_rad_s', limits.final_rate_rad_s),
        ('cone violated', 'cone_violation_s', limits.cone_violation_s),
    ]
    broken = ['lost'] if found['lost'] else []
    if settled_s is None:
        broken.append('not settled')
    elif limits.settle_time_s is not None and settled_s > limits.settle_time_s:
        broken.append('settled late')
    if limits.peak_rate_rad_s is not None and np.any(
            np.array(found['largest_rate_rad_s']) > limits.peak_rate_rad_s):
        broken.append('peak rate')
    return broken + [name for name, key, most in largest
                     if most is not None and not found[key] <= most]
