# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a local solver can do, whichever machine runs its phases."""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program import options
from manifold_mpc_ros.mpc.program.phase import Field
from manifold_mpc_ros.mpc.program.structure import RATE_PENALTY, TERMINAL_PENALTY, Structure
from manifold_mpc_ros.mpc.scaling import Array


class Progress(NamedTuple):
    """How far a solve is; the cost contains the penalties on violations."""

    cost: float
    residual: float
    flag: int
    passes: int


NOTHING_YET = Progress(float('nan'), float('inf'), options.STALLED, 0)


class Plan(ABC):
    """A trajectory that was kept, with how far its solve was."""

    progress: Progress = NOTHING_YET

    def __init__(self, structure: Structure, horizon: int) -> None:
        """Keep what the numbers mean."""
        self.structure, self.horizon = structure, horizon

    @abstractmethod
    def field(self, field: Field) -> Array:
        """Return a field (N + 1, size)."""

    @property
    def torques(self) -> Array:
        """Torques (N, 3), dimensionless."""
        return self.field(f.TORQUE)[:-1]


class Report(NamedTuple):
    """Of a plan, dimensionless.

    Cost of its first stage; ``xi^T P xi / c`` of its first and last node; sum and largest of the
    relative violations of rate limits; by how much it misses the terminal set, relatively.
    """

    first_cost: float
    first_level: float
    last_level: float
    rate_excess: float
    rate_violation: float
    terminal_violation: float

    @property
    def penalties(self) -> float:
        """What the violations add to the cost."""
        return RATE_PENALTY * self.rate_excess + TERMINAL_PENALTY * self.terminal_violation


class Measure(NamedTuple):
    """Of a state: whether it can be used, and how hard the turn is.

    Distance of its rotations from SO(3); |J omega|^2; angle left to turn [rad]; angle that it
    takes to stop the body [rad]; for a slew about the axis of the turn, how much the second torque
    component does beside the first (0 to 1), and how many times faster the quickest axis turns.
    """

    defect: float
    momentum_squared: float
    angle_rad: float
    braking_rad: float
    second_torque: float
    weakness: float


#: What is said of a state that is not finite.
UNUSABLE = Measure(np.inf, np.inf, np.nan, np.nan, np.nan, np.nan)


class Course(ctypes.Structure):
    """A closed loop that the solver runs by itself: when to stop, and what is recorded.

    The struct ``course`` of driver.c. A tick is not taken when its plan violates a limit by more
    than ``violation``, or costs more than the one before promised plus ``promise`` of it (at least
    of ``least_promise``) with ``near_rad`` or more left to turn.
    """

    _fields_ = [(name, kind) for kind, names in (  # type: ignore[misc]
        (ctypes.c_double, 'near_rad violation promise least_promise promised'),
        (ctypes.c_void_p, 'states torques costs passes'), (ctypes.c_long, 'ticks'),
    ) for name in names.split()]


@dataclass(frozen=True)
class Recording:
    """States (T, 12) (R_NB row by row, rate), torques (T, 3), costs and passes (T,)."""

    states: Array
    torques: Array
    costs: Array
    passes: NDArray[np.int_]

    @classmethod
    def of(cls, ticks: int) -> Recording:
        """Allocate for so many ticks."""
        return cls(np.zeros((ticks, 12)), np.zeros((ticks, 3)), np.zeros(ticks),
                   np.zeros(ticks, dtype=np.int_))

    def record(self, tick: int, state: Array, plan: Plan, report: Report, passes: int) -> None:
        """Write one tick."""
        self.states[tick], self.torques[tick] = state, plan.torques[0]
        self.costs[tick], self.passes[tick] = plan.progress.cost - report.penalties, passes


class LocalSolver(ABC):
    """One trajectory under way: start it, iterate it, keep it. Not for two threads at once."""

    def __init__(self, structure: Structure, horizon: int) -> None:
        """Keep what the numbers mean."""
        self.structure, self.horizon = structure, horizon

    @abstractmethod
    def measure(self, R_NB: Array, R_ND: Array, omega: Array) -> Measure:
        """Set the state from attitude, commanded attitude (3, 3) and dimensionless rate (3,)."""

    @abstractmethod
    def flip(self) -> None:
        """Turn the sign of the starting quaternion: the slew goes the other way round."""

    @abstractmethod
    def begin_slew(self, mu: float, lean: Array, lean_steps: int) -> None:
        """Start from the slew law, leaning for the first steps, with barrier parameter mu."""

    @abstractmethod
    def begin_shift(self, mu: float, plan: Plan) -> None:
        """Start from a plan, one stage ahead."""

    @abstractmethod
    def iterate(self, most: int, deadline_s: float = np.inf) -> None:
        """Run up to ``most`` passes in all, until it ends or time.monotonic is at the deadline."""

    @abstractmethod
    def improve(self, plan: Plan, deadline_s: float = np.inf) -> int:
        """Improve a plan, one stage ahead; return the passes, negative when none converged.

        A plan that time has run out for counts as converged.
        """

    @abstractmethod
    def set_body(self, inertia: Array, torque: Array) -> None:
        """Set the body that `follow` and `advance` move: inertia (3, 3), disturbance (3,)."""

    @abstractmethod
    def state(self) -> Array:
        """Return the state (12,): R_NB row by row and dimensionless rate."""

    @abstractmethod
    def advance(self, torque: Array) -> None:
        """Move the state on by one step of the body under a torque (3,)."""

    @abstractmethod
    def follow(self, plan: Plan, course: Course, recording: Recording, first: int) -> int:
        """Close the loop from tick ``first`` on, ``plan`` kept up to date.

        Return the first tick that needs more than a warm start, or the number of ticks.
        """

    @property
    @abstractmethod
    def progress(self) -> Progress:
        """How far the solve is."""

    @property
    @abstractmethod
    def elapsed_s(self) -> float:
        """Time that starts and passes have taken so far [s]."""

    @abstractmethod
    def new_plan(self) -> Plan:
        """Return memory for a plan."""

    @abstractmethod
    def keep(self, plan: Plan) -> None:
        """Copy the trajectory into a plan."""

    @abstractmethod
    def report(self, plan: Plan) -> Report:
        """Say what the caller of a solve wants to know of a plan."""

    @abstractmethod
    def poses(self) -> Array:
        """Return R_NB row by row and dimensionless rate (N + 1, 12) of the plan reported last."""
