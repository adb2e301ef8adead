# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The course that a controller takes from one case: a pure function of both.

The body is the controller's own model, which is what the theory speaks about, or the simulator's
plant with what the case drew for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeAlias, cast

import numpy as np

from manifold_mpc_ros.dynamics.inertia import free_steps_exist
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lab.campaign.case import Case
from manifold_mpc_ros.lab.campaign.keys import MODEL
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.closed_loop import Body, ModelPlant, Solution
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import AnyArray as Array
from manifold_mpc_ros.sim.plant import Plant

Path: TypeAlias = list[tuple[Array, Array]]
Advance: TypeAlias = Callable[[Array, Path], bool]


class PlanningSolution(Solution, Protocol):
    """What a campaign reads of one answer beyond what the loop does."""

    @property
    def R_NB(self) -> Array:
        """The planned attitudes (N + 1, 3, 3)."""

    @property
    def searched(self) -> bool:
        """Whether the global search ran."""


class PlanningController(Protocol):
    """What a campaign needs of a control law; `AttitudeMpc` is such."""

    def reset(self) -> None:
        """Forget the warm start."""

    def solve(self, R_NB: Array, omega_BN_B: Array, R_ND: Array) -> PlanningSolution:
        """Answer a measured state."""


@dataclass(frozen=True, eq=False)
class Course:
    """One closed loop: row k is the true state at step k and the answer to it, n rows.

    The last answer is computed and not applied. ``lost`` says that the loop ended early because
    the state after its last row does not exist, or has no free step and so no stage cost (for a
    plant: that it could not be advanced).
    """

    case: Case
    lost: bool
    path_step_s: float
    R_NB: Array          # (n, 3, 3)
    omega_BN_B: Array    # (n, 3) [rad/s]
    torque_B_n_m: Array  # (n, 3)
    plan_R_NB: Array     # (n, N + 1, 3, 3)
    value: Array         # (n,) V, the cost of the plan
    status: Array        # (n,) text
    searched: Array      # (n,) bool
    solve_time_s: Array  # (n,)
    path_R_NB: Array     # (m, 3, 3) every state of the body, `path_step_s` apart
    path_omega_BN_B: Array  # (m, 3) [rad/s]

    @property
    def R_DB(self) -> Array:
        """The attitude seen from the commanded one (n, 3, 3)."""
        return so3.attitude_error_B(self.case.R_ND, self.R_NB)

    @property
    def plan_R_DB(self) -> Array:
        """The planned attitudes seen from the commanded one (n, N + 1, 3, 3)."""
        return so3.attitude_error_B(self.case.R_ND, self.plan_R_NB)


def run_case(controller: PlanningController, plan: CampaignPlan, case: Case) -> Course:
    """Run one closed loop from a cold start."""
    controller.reset()
    body, advance = _body_of(plan, case)
    path = [(body.R_NB, body.omega_BN_B)]
    rows: list[tuple[Any, ...]] = []
    lost = False
    while len(rows) <= plan.steps and not lost:
        R_NB, omega_BN_B = body.R_NB, body.omega_BN_B
        answer = controller.solve(*body.measure(), case.R_ND)
        rows.append((R_NB, omega_BN_B, answer.torque_B_n_m, answer.R_NB, answer.cost,
                     str(answer.status), answer.searched, answer.solve_time_s))
        lost = not advance(answer.torque_B_n_m, path)
    columns = (np.array(column) for column in zip(*rows))
    return Course(case, lost, body.step_s, *columns, *(np.array(column) for column in zip(*path)))


def _body_of(plan: CampaignPlan, case: Case) -> tuple[Body, Advance]:
    """Return the body in its initial state, and what advances it by a control step, if it can.

    The states on the way are appended to the list that it is given.
    """
    if case.drawn_from.body == MODEL:
        return _model(plan, case)
    return _plant(plan, case)


def _model(plan: CampaignPlan, case: Case) -> tuple[Body, Advance]:
    """Return the controller's own model, to whose states a free step has to exist."""
    config = plan.config
    model = ModelPlant(config, case.R_NB, case.omega_BN_B)

    def advance(tau_B: Array, path: Path) -> bool:
        try:
            model.step(tau_B)
        except StepExistenceError:
            return False
        path.append((model.R_NB, model.omega_BN_B))
        return bool(free_steps_exist(model.omega_BN_B, config.inertia_kg_m2, config.step_s))

    return model, advance


def _plant(plan: CampaignPlan, case: Case) -> tuple[Body, Advance]:
    """Return the simulator's body with what the case drew for it."""
    w, x, y, z = so3.quaternion_from_rotation(case.R_NB)
    config = replace(
        plan.body, inertia_kg_m2=case.inertia_kg_m2, initial_attitude_xyzw=np.array([x, y, z, w]),
        initial_rate_rad_s=case.omega_BN_B, disturbance_torque_n_m=case.disturbance_n_m,
        attitude_noise_std_rad=case.attitude_noise_std_rad,
        rate_noise_std_rad_s=case.rate_noise_std_rad_s, seed=case.noise_seed)
    plant = Plant(config, disturbance_frame=cast(Any, case.drawn_from.disturbance.frame))
    substeps = config.steps_per_control

    def advance(tau_B: Array, path: Path) -> bool:
        for _ in range(substeps):
            plant.step(tau_B)
            path.append((plant.R_NB, plant.omega_BN_B))
        return plant.counters.frozen == 0

    return plant, advance
