# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cases of a campaign of closed loops, and the course that a controller takes from each.

A case is a function of the seed and its own name alone, whatever else the campaign runs. The
body is the controller's own model, which is what the theory speaks about; the commanded
attitude is the identity.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ConfigurationError, StepExistenceError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.sim.closed_loop import Solution

Array: TypeAlias = NDArray[Any]

RANDOM, OPPOSITE = 'random', 'opposite'
KINDS = (RANDOM, OPPOSITE)


@dataclass(frozen=True)
class CampaignSettings:
    """What a campaign draws, how long a loop runs [steps], and when it counts as settled."""

    seed: int = 0
    largest_rate_rad_s: float = 0.3
    steps: int = 60
    settled_rad: float = float(np.radians(0.1))
    settled_rad_s: float = 1e-3

    def check(self, config: AttitudeMpcConfig) -> None:
        """Raise ConfigurationError when some drawn rate has no guaranteed free step."""
        moments = np.linalg.eigvalsh(config.inertia_kg_m2)
        most = float(moments[0] / (config.step_s * moments[-1]))
        if not 0.0 <= self.largest_rate_rad_s < most:
            raise ConfigurationError(
                'largest rate', self.largest_rate_rad_s,
                f'a rate from 0 to below {most:.4g} rad/s, where the step of this body exists')


@dataclass(frozen=True, order=True)
class CaseName:
    """Which case: of which kind, and its index within the kind."""

    kind: str
    index: int

    def __str__(self) -> str:
        """Return for example ``random-17``."""
        return f'{self.kind}-{self.index}'

    @classmethod
    def parse(cls, text: str) -> CaseName:
        """Read what `str` gives; raises ConfigurationError."""
        match = re.fullmatch(rf'({"|".join(KINDS)})-(\d{{1,9}})', text)
        if match is None:
            raise ConfigurationError('case', text, f"a name like '{RANDOM}-17' or '{OPPOSITE}-3'")
        return cls(match[1], int(match[2]))


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

    def solve(self, R_NB: Array, omega_BN_B: Array) -> PlanningSolution:
        """Answer a measured state."""


@dataclass(frozen=True, eq=False)
class Course:
    """One closed loop: row k is the state at step k and the answer to it, n rows.

    The last answer is computed and not applied. ``lost`` says that the loop ended early because
    the state after its last row does not exist, or has no free step and so no stage cost.
    """

    name: CaseName
    lost: bool
    R_NB: Array          # (n, 3, 3)
    omega_BN_B: Array    # (n, 3) [rad/s]
    torque_B_n_m: Array  # (n, 3)
    plan_R_NB: Array     # (n, N + 1, 3, 3)
    value: Array         # (n,) V, the cost of the plan
    status: Array        # (n,) text
    searched: Array      # (n,) bool
    solve_time_s: Array  # (n,)


def start_of(config: AttitudeMpcConfig, settings: CampaignSettings, name: CaseName
             ) -> tuple[Array, Array]:
    """Map a case's name to its attitude (3, 3) and rate (3,) [rad/s].

    `random`: attitude uniform on SO(3) (for pointing, direction and roll are uniform too), rate
    uniform in a ball. `opposite`: at rest, by exactly 180 degrees about the principal axes of
    inertia for the indices 0 to 2 and about a random axis from there on; for pointing the exact
    antipode, Gamma = -b, with a random roll.
    """
    rng = np.random.default_rng([settings.seed, KINDS.index(name.kind), name.index])
    if name.kind == OPPOSITE:
        return _opposite(config, rng, name.index), np.zeros(3)
    attitude = so3.random_rotations(rng, 1)[0]
    length = settings.largest_rate_rad_s * rng.uniform() ** (1 / 3)
    return attitude, length * _unit(rng.normal(size=3))


def run_case(controller: PlanningController, config: AttitudeMpcConfig,
             settings: CampaignSettings, name: CaseName) -> Course:
    """Run one closed loop from a cold start on the model of the configuration."""
    controller.reset()
    R, omega = start_of(config, settings, name)
    guard = float(np.linalg.eigvalsh(config.inertia_kg_m2)[0])
    rows: list[tuple[Any, ...]] = []
    lost = False
    while len(rows) <= settings.steps and not lost:
        answer = controller.solve(R, omega)
        rows.append((R, omega, answer.torque_B_n_m, answer.R_NB, answer.cost, str(answer.status),
                     answer.searched, answer.solve_time_s))
        try:
            R, omega = lgvi_step(
                R, omega, answer.torque_B_n_m, inertia_kg_m2=config.inertia_kg_m2,
                step_s=config.step_s, forcing=cast(Any, config.forcing))
            lost = float(np.linalg.norm(config.step_s * config.inertia_kg_m2 @ omega)) >= guard
        except StepExistenceError:
            lost = True
    columns = (np.array(column) for column in zip(*rows))
    return Course(name, lost, *columns)


def _opposite(config: AttitudeMpcConfig, rng: np.random.Generator, index: int) -> Array:
    """Return a half turn (3, 3), for pointing one that takes b to -b."""
    axis = _unit(rng.normal(size=3))
    if config.target == 'pointing':
        b = config.pointing_axis_B
        axis = _unit(np.cross(b, axis))
    elif index < 3:
        axis = np.linalg.eigh(config.inertia_kg_m2)[1][:, index]
    return 2.0 * np.outer(axis, axis) - np.eye(3)


def _unit(v: Array) -> Array:
    """Return v (3,) divided by its length."""
    return v / np.linalg.norm(v)
