# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a local solver can do, whichever machine runs its phases."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.mpc.kernel import fields as f
from manifold_mpc_ros.mpc.kernel import rules
from manifold_mpc_ros.mpc.kernel.phase import Field
from manifold_mpc_ros.mpc.kernel.structure import RATE_PENALTY, TERMINAL_PENALTY, Structure
from manifold_mpc_ros.mpc.scaling import Array


class Progress(NamedTuple):
    """How far a solve is; the cost contains the penalties on violations."""

    cost: float
    residual: float
    flag: int
    passes: int


NOTHING_YET = Progress(float('nan'), float('inf'), rules.STALLED, 0)


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
    """Of a state: distance of its rotations from SO(3), |J omega|^2, angle left to turn [rad]."""

    defect: float
    momentum_squared: float
    angle_rad: float


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

    @property
    @abstractmethod
    def progress(self) -> Progress:
        """How far the solve is."""

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
