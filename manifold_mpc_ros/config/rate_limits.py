# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Limits on the body rate, as everything outside the solver's generated code evaluates them.

The formulas use arithmetic only: omega_BN_B (3 entries, [rad/s]) may hold floats, arrays over many
states, CasADi expressions, or balls of a proof.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from manifold_mpc_ros.config.checks import CORNERS
from manifold_mpc_ros.lie.arrays import Array, BoolArray


class RateLimit(ABC):
    """A set of body rates that holds zero."""

    #: What reports call it, and what it says.
    name: str
    description: str

    @abstractmethod
    def values(self, omega_BN_B: Any) -> list[Any]:
        """Return smooth functions of the rate, none positive inside; near 0, relative excess."""

    @abstractmethod
    def ratios(self, omega_BN_B: Any) -> dict[str, Any]:
        """Return numbers by name, at most 1 inside."""

    #: Whether no axis is free.
    limits_every_axis: bool = True

    @property
    @abstractmethod
    def largest_rate_rad_s(self) -> float:
        """The largest |omega|; axes without a limit do not count."""

    @abstractmethod
    def rate_about(self, axis_B: Array) -> float:
        """Return the largest rate about a unit axis (3,) [rad/s]."""

    @abstractmethod
    def largest_momentum_n_m_s(self, inertia_kg_m2: Array) -> float:
        """Return the largest |J omega|; axes without a limit do not count."""


class RateBox(RateLimit):
    """``|omega_i| <= max_rate_i``; inf where an axis is free."""

    name = 'rate'
    description = 'rate limit, |omega_i| <= max_rate_i'

    def __init__(self, max_rate_rad_s: Array) -> None:
        """Keep the half widths (3,)."""
        self.max_rate_rad_s = max_rate_rad_s
        self._limited = np.flatnonzero(np.isfinite(max_rate_rad_s)).tolist()
        self._limits = [(i, f'rate {"xyz"[i]}', float(max_rate_rad_s[i])) for i in self._limited]
        self.limits_every_axis = len(self._limited) == 3

    def values(self, omega_BN_B: Any) -> list[Any]:
        """Return ``+-omega_i / max_rate_i - 1`` of the limited axes."""
        return [sign * omega_BN_B[i] / limit - 1
                for i, _, limit in self._limits for sign in (1, -1)]

    def ratios(self, omega_BN_B: Any) -> dict[str, Any]:
        """Return ``|omega_i| / max_rate_i`` of the limited axes."""
        return {name: abs(omega_BN_B[i]) / limit for i, name, limit in self._limits}

    @property
    def largest_rate_rad_s(self) -> float:
        """The distance of a corner."""
        return float(np.linalg.norm(self.max_rate_rad_s[self._limited]))

    def rate_about(self, axis_B: Array) -> float:
        """Return the rate at which the first axis is at its limit, inf where all are free."""
        part = float(np.max(np.abs(axis_B) / self.max_rate_rad_s))
        return 1.0 / part if part else np.inf

    def largest_momentum_n_m_s(self, inertia_kg_m2: Array) -> float:
        """Return |J omega| of the worst corner."""
        box = np.where(np.isfinite(self.max_rate_rad_s), self.max_rate_rad_s, 0.0)
        return float(np.linalg.norm((CORNERS * box) @ inertia_kg_m2, axis=1).max())


class RateEllipsoid(RateLimit):
    """``omega^T E omega <= 1``, E (3, 3) symmetric and positive definite [s^2]."""

    name = 'rate ellipsoid'
    description = 'rate limit, omega^T E omega <= 1'

    def __init__(self, E_s2: Array) -> None:
        """Keep E."""
        self.E_s2 = E_s2

    def _form(self, omega_BN_B: Any) -> Any:
        """Return ``omega^T E omega``."""
        rows = [sum(float(e) * w for e, w in zip(row, omega_BN_B)) for row in self.E_s2]
        return sum(w * row for w, row in zip(omega_BN_B, rows))

    def values(self, omega_BN_B: Any) -> list[Any]:
        """Return ``(omega^T E omega - 1) / 2``."""
        return [(self._form(omega_BN_B) - 1) / 2]

    def ratios(self, omega_BN_B: Any) -> dict[str, Any]:
        """Return ``omega^T E omega``."""
        return {self.name: self._form(omega_BN_B)}

    @property
    def largest_rate_rad_s(self) -> float:
        """The longest half axis, ``lambda_min(E)^(-1/2)``."""
        return float(np.linalg.eigvalsh(self.E_s2)[0]) ** -0.5

    def rate_about(self, axis_B: Array) -> float:
        """Return ``(a^T E a)^(-1/2)``."""
        return float(axis_B @ self.E_s2 @ axis_B) ** -0.5

    def largest_momentum_n_m_s(self, inertia_kg_m2: Array) -> float:
        """Return ``lambda_max(J E^-1 J)^(1/2)``."""
        spread = inertia_kg_m2 @ np.linalg.solve(self.E_s2, inertia_kg_m2)
        return float(np.linalg.eigvalsh((spread + spread.T) / 2)[-1]) ** 0.5

    def largest_energy_j(self, inertia_kg_m2: Array) -> float:
        """Return the largest kinetic energy below which every rate is inside [J].

        ``omega^T E omega <= lambda_max(J^-1 E) omega^T J omega``.
        """
        worst = np.linalg.eigvals(np.linalg.solve(inertia_kg_m2, self.E_s2)).real.max()
        return 1.0 / (2.0 * float(worst))


def rates_beyond(limits: Sequence[RateLimit], omega_BN_B: Array, slack: float) -> BoolArray:
    """Return which of n rates (n, 3) leave a limit by more than a relative slack."""
    beyond = np.zeros(len(omega_BN_B), dtype=bool)
    for limit in limits:
        for value in limit.values(omega_BN_B.T / (1.0 + slack)):
            beyond |= value > 0.0
    return beyond
