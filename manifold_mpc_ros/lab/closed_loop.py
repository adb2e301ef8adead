# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The closed loop without ROS: a controller, a simulated body, and the log of what happened."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import AnyArray as Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution


class Body(Protocol):
    """What the loop needs of a simulated body; `Plant` and `ModelPlant` are such."""

    @property
    def step_s(self) -> float:
        """The time that one call of `step` takes [s]."""

    @property
    def R_NB(self) -> Array:
        """The true attitude (3, 3)."""

    @property
    def omega_BN_B(self) -> Array:
        """The true body rate (3,) [rad/s]."""

    def step(self, tau_B: Array) -> None:
        """Advance by one step under a torque (3,) [N m]."""

    def measure(self) -> tuple[Array, Array]:
        """Return attitude and rate as the sensors see them."""


class Solution(Protocol):
    """What the loop reads of one answer; `AttitudeMpcSolution` is such."""

    @property
    def torque_B_n_m(self) -> Array:
        """The torque (3,) to apply now [N m]."""

    @property
    def cost(self) -> float:
        """The cost of the plan."""

    @property
    def iterations(self) -> int:
        """Iterations that the plan took."""

    @property
    def status(self) -> str:
        """How the solution ended."""

    @property
    def solve_time_s(self) -> float:
        """Time that the solution took [s]."""


class Controller(Protocol):
    """What the loop needs of a control law; `AttitudeMpc` is such."""

    def solve(
        self, R_NB: Array, omega_BN_B: Array, R_ND: Array | None = None,
    ) -> Solution:
        """Answer a measured state."""


@dataclass(frozen=True)
class Tick:
    """One control step as it happens, for progress displays."""

    index: int
    last_index: int
    time_s: float
    attitude_error_rad: float
    rate_rad_s: float
    torque_B_n_m: Array
    status: str


@dataclass(frozen=True, eq=False)
class ClosedLoopLog:
    """The true state and the command at each control step, n of them, both ends included.

    Row k holds the state at ``time_s[k]`` and the torque commanded there, which acts until row
    k + 1; the command of the last row is computed and not applied.
    """

    time_s: Array              # (n,) [s]
    R_NB: Array                # (n, 3, 3) true attitude
    omega_BN_B: Array          # (n, 3) true body rate [rad/s]
    torque_B_n_m: Array        # (n, 3) commanded torque [N m]
    attitude_error_rad: Array  # (n,) angle left to turn [rad]
    cost: Array                # (n,)
    iterations: Array          # (n,)
    status: Array              # (n,) text
    solve_time_s: Array        # (n,) [s]

    @property
    def rate_rad_s(self) -> Array:
        """The length of the body rate (n,) [rad/s]."""
        return np.linalg.norm(self.omega_BN_B, axis=1)

    def settled_at(self, attitude_rad: float, rate_rad_s: float) -> float | None:
        """Return the time after which both errors stay below their bounds, None if never."""
        return settling_time(
            self.time_s,
            (self.attitude_error_rad < attitude_rad) & (self.rate_rad_s < rate_rad_s))

    def save(self, path: str | Path) -> None:
        """Write all arrays to a numpy archive (.npz)."""
        with Path(path).open('wb') as file:
            np.savez_compressed(
                file, **{field.name: getattr(self, field.name) for field in fields(self)})

    @classmethod
    def load(cls, path: str | Path) -> ClosedLoopLog:
        """Read what `save` wrote.

        Raises ConfigurationError when the file is not such an archive.
        """
        try:
            with np.load(path, allow_pickle=False) as archive:
                return cls(**{field.name: archive[field.name] for field in fields(cls)})
        except (OSError, ValueError, KeyError) as error:
            raise ConfigurationError(
                'closed-loop log', str(path), f'an archive of a closed loop ({error})') from None


def settling_time(time_s: Array, below: Array) -> float | None:
    """Return the first time from which ``below`` (n,) holds to the end, None if there is none."""
    outside = np.flatnonzero(~below)
    first = 0 if outside.size == 0 else int(outside[-1]) + 1
    return float(time_s[first]) if first < len(time_s) else None


class ModelPlant:
    """A body that does exactly what the controller predicts: same inertia, step and forcing.

    No limits, disturbance or noise. For reproducing the paper, and for tests of statements that
    hold for the model; `Plant` is the one to judge a controller by.
    """

    def __init__(
        self, config: AttitudeMpcConfig, R_NB: ArrayLike,
        omega_BN_B: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start from an attitude (3, 3) and a body rate (3,) [rad/s]."""
        self.config = config
        self.R_NB = np.array(R_NB, dtype=np.float64)
        self.omega_BN_B = np.array(omega_BN_B, dtype=np.float64)

    @property
    def step_s(self) -> float:
        """The time that one call of `step` takes, the controller's step [s]."""
        return self.config.step_s

    def step(self, tau_B: ArrayLike) -> None:
        """Advance by one step of the model under a torque (3,) [N m].

        Raises StepExistenceError beyond the guard: the model has no substeps.
        """
        self.R_NB, self.omega_BN_B = lgvi_step(
            self.R_NB, self.omega_BN_B, tau_B, inertia_kg_m2=self.config.inertia_kg_m2,
            step_s=self.config.step_s,
            forcing='paper' if self.config.forcing == 'paper' else 'symmetric')

    def measure(self) -> tuple[Array, Array]:
        """Return the exact attitude (3, 3) and body rate (3,) [rad/s]."""
        return self.R_NB, self.omega_BN_B


class SlewingController:
    """The controller, with profiles in the place of setpoints; one tick a solve."""

    def __init__(self, mpc: AttitudeMpc, slews: SlewPlanner) -> None:
        """Begin at time zero."""
        self._mpc, self._slews, self._ticks = mpc, slews, 0

    def solve(self, R_NB: ArrayLike, omega_BN_B: ArrayLike, R_ND: ArrayLike | None = None
              ) -> AttitudeMpcSolution:
        """Answer the measured state of the next tick."""
        config, state = self._mpc.config, (np.asarray(R_NB), np.asarray(omega_BN_B))
        time_ns = round(self._ticks * config.step_s * NANOSECONDS)
        self._ticks += 1
        target = self._slews.target(
            FixedTarget(np.eye(3) if R_ND is None else np.asarray(R_ND)), state, time_ns, {})
        return self._mpc.solve(
            *state, target.at(time_ns)[0],
            reference=target.over_horizon(time_ns, config.step_s, config.horizon))


def run_closed_loop(
    mpc: Controller,
    plant: Body,
    duration_s: float,
    control_step_s: float,
    R_ND: Array | None = None,
    on_tick: Callable[[Tick], None] | None = None,
    error_angle: Callable[[Array], Array] = so3.angle,
) -> ClosedLoopLog:
    """Run a controller against a body from the body's present state on.

    Arguments
    ---------
    mpc
        Asked once at each control step, with the measured state.
    plant
        Advances by its own smaller steps under the last torque (zero-order hold).
    duration_s, control_step_s
        Length of the run and period of control [s]; multiples of each other and of the plant's
        step: the run has round(duration / control step) control steps.
    R_ND
        Commanded attitude (3, 3), default identity.
    on_tick
        Called after each control step.
    error_angle
        Maps ``R_ND^T R_NB`` to the angle left to turn [rad]; pointing has its own
        (:func:`manifold_mpc_ros.mpc.target.error_angle`).

    Raises ConfigurationError when the periods do not divide each other.

    """
    ticks = _multiple('duration_s', duration_s, 'control step', control_step_s)
    substeps = _multiple('control_step_s', control_step_s, 'plant step', plant.step_s)
    desired = np.eye(3) if R_ND is None else np.asarray(R_ND, dtype=np.float64)
    rows: list[tuple[Any, ...]] = []
    for index in range(ticks + 1):
        solution = mpc.solve(*plant.measure(), desired)
        R_NB, omega_BN_B = plant.R_NB, plant.omega_BN_B
        error = float(error_angle(so3.attitude_error_B(desired, R_NB)))
        time_s, status = index * control_step_s, _text(solution.status)
        rows.append((
            time_s, R_NB, omega_BN_B, solution.torque_B_n_m, error, solution.cost,
            solution.iterations, status, solution.solve_time_s))
        if on_tick is not None:
            on_tick(Tick(index, ticks, time_s, error, float(np.linalg.norm(omega_BN_B)),
                         solution.torque_B_n_m, status))
        if index < ticks:
            for _ in range(substeps):
                plant.step(solution.torque_B_n_m)
    columns = zip(*rows, strict=True)
    return ClosedLoopLog(*(np.array(column) for column in columns))


def _multiple(name: str, value: float, of_name: str, of: float) -> int:
    """Return value / of as a whole number."""
    ratio = value / of if math.isfinite(value) else 0.0
    if round(ratio) < 1 or not math.isclose(ratio, round(ratio), rel_tol=1e-9):
        raise ConfigurationError(name, value, f'a multiple of the {of_name} {of:g} s')
    return round(ratio)


def _text(status: str) -> str:
    """Return the plain text of a status, which may be an enum of strings."""
    return str(getattr(status, 'value', status))
