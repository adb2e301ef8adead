# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What one closed loop of a campaign shows, and what it breaks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.sim import turning
from manifold_mpc_ros.sim.campaign import CampaignSettings, Course
from manifold_mpc_ros.sim.closed_loop import settling_time
from manifold_mpc_ros.sim.stage_cost import direction_B, stage_costs

Array: TypeAlias = NDArray[Any]

# The decrease is violated when V(k+1) > V(k) - L(k) by more than RELATIVE of it plus ABSOLUTE.
RELATIVE, ABSOLUTE = 1e-6, 1e-9
# A turn that changes more often than this chatters.
MOST_CHANGES = 1
# A limit counts as exceeded beyond these parts of it: the solver keeps torques strictly inside,
# and rates within its tolerance.
TORQUE_MARGIN, RATE_MARGIN = 1e-9, 1e-6


@dataclass(frozen=True)
class Outcome:
    """The figures of one case; degrees, seconds, N m and rad/s as the names say.

    ``changes`` counts changes of the side of the turn (for pointing: reversals of the direction);
    ``largest_excess`` is the largest ``V(k+1) - (V(k) - L(k))`` over ``|V(k) - L(k)| + 1e-3``, a
    violation when above RELATIVE. ``feasibility_lost`` counts infeasible ticks that follow a
    feasible one, ``limits_exceeded`` torques over their limit and rates over theirs where the
    plan before promised otherwise. ``broken`` names what the theory forbids and happened.
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
    lost: bool
    broken: tuple[str, ...]
    cold_solve_s: float
    warm_solves_s: tuple[float, ...]

    def record(self) -> dict[str, Any]:
        """Return every figure but the solve times, which no two runs share."""
        return {key: value for key, value in vars(self).items()
                if key not in ('cold_solve_s', 'warm_solves_s')}


def judge(course: Course, config: AttitudeMpcConfig, settings: CampaignSettings) -> Outcome:
    """Map a closed loop to its figures."""
    angle, rate = target_angle(config, course.R_NB), np.linalg.norm(course.omega_BN_B, axis=1)
    below = (angle < settings.settled_rad) & (rate < settings.settled_rad_s)
    settled_s = settling_time(config.step_s * np.arange(len(below)), below)
    excess = decrease_excess(course, config)
    infeasible = course.status == 'infeasible'
    pointing = config.target == 'pointing'
    found: dict[str, Any] = {
        'settled_s': None if course.lost else settled_s,
        'changes': count_turn_changes(course, config),
        'decrease_violations': int(np.count_nonzero(~(excess <= RELATIVE))),
        'infeasible': int(np.count_nonzero(infeasible)),
        'not_converged': int(np.count_nonzero(np.isin(course.status, ('feasible', 'failed')))),
        'feasibility_lost': int(np.count_nonzero(infeasible[1:] & ~infeasible[:-1])),
        'limits_exceeded': _exceeded(course, config),
        'lost': course.lost,
    }
    return Outcome(
        name=str(course.name), initial_angle_deg=float(np.degrees(angle[0])),
        initial_rate_rad_s=float(rate[0]), final_angle_deg=float(np.degrees(angle[-1])),
        final_rate_rad_s=float(rate[-1]), largest_excess=float(np.max(excess, initial=-np.inf)),
        searches=int(np.count_nonzero(course.searched)),
        largest_torque_n_m=tuple(np.abs(course.torque_B_n_m).max(axis=0).tolist()),
        largest_rate_rad_s=tuple(np.abs(course.omega_BN_B).max(axis=0).tolist()),
        roll_turned_deg=float(np.degrees(turning.roll_turned(
            config.pointing_axis_B, course.R_NB))) if pointing else None,
        broken=tuple(_broken(found)), cold_solve_s=float(course.solve_time_s[0]),
        warm_solves_s=tuple(course.solve_time_s[1:].tolist()), **found)


def target_angle(config: AttitudeMpcConfig, R_NB: Array) -> Array:
    """Return the angle left to the identity, for pointing from Gamma to b (n,) [rad]."""
    if config.target == 'attitude':
        return so3.angle(R_NB)
    gamma = direction_B(config.pointing_axis_B, R_NB)
    across = np.linalg.norm(np.cross(gamma, config.pointing_axis_B), axis=-1)
    return np.arctan2(across, gamma @ config.pointing_axis_B)


def decrease_excess(course: Course, config: AttitudeMpcConfig) -> Array:
    """Return ``(V(k+1) - (V(k) - L(k))) / (|V(k) - L(k)| + ABSOLUTE / RELATIVE)`` (n - 1,).

    V is the solver's, L is not. A value that is not finite gives one that is not, a violation.
    """
    paid = stage_costs(config, course.R_NB, course.omega_BN_B, course.torque_B_n_m)
    bound = course.value[:-1] - paid[:-1]
    return (course.value[1:] - bound) / (np.abs(bound) + ABSOLUTE / RELATIVE)


def count_turn_changes(course: Course, config: AttitudeMpcConfig) -> int:
    """Return how often the side of the turn, for pointing its direction, changed."""
    if config.target == 'pointing':
        back = turning.reversals(config.pointing_axis_B, course.R_NB, course.plan_R_NB)
        return int(np.count_nonzero(back))
    return turning.count_changes(turning.sides_of_turn(course.R_NB, course.plan_R_NB))


def _exceeded(course: Course, config: AttitudeMpcConfig) -> int:
    """Return how many ticks exceed a limit; rates only where the plan before kept them."""
    count = 0
    if config.max_torque_n_m is not None:
        limit = config.max_torque_n_m * (1.0 + TORQUE_MARGIN)
        count += int(np.count_nonzero(np.any(np.abs(course.torque_B_n_m) > limit, axis=1)))
    if config.max_rate_rad_s is not None:
        limit = config.max_rate_rad_s * (1.0 + RATE_MARGIN)
        over = np.any(np.abs(course.omega_BN_B[1:]) > limit, axis=1)
        promised = np.isin(course.status[:-1], ('converged', 'feasible'))
        count += int(np.count_nonzero(over & promised))
    return count


def _broken(found: dict[str, Any]) -> list[str]:
    """Return the names of what should not have happened."""
    checks = {
        'lost': found['lost'],
        'not settled': found['settled_s'] is None,
        'chatter': found['changes'] > MOST_CHANGES,
        'decrease': found['decrease_violations'] > 0,
        'feasibility lost': found['feasibility_lost'] > 0,
        'limit exceeded': found['limits_exceeded'] > 0,
    }
    return [name for name, broke in checks.items() if broke]
