# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Limits on the body rate, as everything outside the solver's generated code evaluates them.

The formulas of values and ratios use arithmetic only: omega_BN_B (3 entries, [rad/s]) may hold
floats, arrays over many states, CasADi expressions, or balls of a proof.

A rigid body is not the model, whose step is of second order: from one node to the next it reaches
another rate, and between them a larger one. `rate_margins` bounds both (docs/theory.md, (31)).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from manifold_mpc_ros.config.checks import CORNERS
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array, BoolArray

#: Largest rotation in one step that the rate limits may allow [rad]. The principal branch of the
#: implicit step ends at pi/2 (docs/theory.md, section 2).
MAX_STEP_ANGLE_RAD = 1.5

#: Parts of a limit by the name of its ratio.
Margins = dict[str, float]


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

    @abstractmethod
    def used(self, omega_BN_B: Array) -> dict[str, Array]:
        """Map rates (n, 3) [rad/s] to the parts (n,) of the limit that they use, by name."""

    @abstractmethod
    def used_at_most(self, box_rad_s: Array) -> Margins:
        """Return the largest parts that rates with ``|omega_i| <= box_i`` use."""

    @abstractmethod
    def smaller(self, margins: Margins) -> RateLimit:
        """Return the limit that is smaller by these parts."""

    @property
    @abstractmethod
    def half_widths_rad_s(self) -> Array:
        """The half widths (3,) of the smallest box round it, inf where an axis is free."""

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

    def used(self, omega_BN_B: Array) -> dict[str, Array]:
        """Return the ratios."""
        return self.ratios(omega_BN_B.T)

    def used_at_most(self, box_rad_s: Array) -> Margins:
        """Return the ratios of its corner."""
        return {name: float(part) for name, part in self.ratios(box_rad_s).items()}

    def smaller(self, margins: Margins) -> RateBox:
        """Return the box with every half width less by its part."""
        return RateBox(self.max_rate_rad_s * (1.0 - np.array(
            [margins.get(f'rate {axis}', 0.0) for axis in 'xyz'])))

    @property
    def half_widths_rad_s(self) -> Array:
        """Its own."""
        return self.max_rate_rad_s

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

    def used(self, omega_BN_B: Array) -> dict[str, Array]:
        """Return ``(omega^T E omega)^(1/2)``."""
        return {self.name: np.sqrt(self._form(omega_BN_B.T))}

    def used_at_most(self, box_rad_s: Array) -> Margins:
        """Return that of the worst corner; it is convex."""
        return {self.name: float(self.used(CORNERS * box_rad_s)[self.name].max())}

    def smaller(self, margins: Margins) -> RateEllipsoid:
        """Return the ellipsoid with all half axes less by its part."""
        return RateEllipsoid(self.E_s2 / (1.0 - margins.get(self.name, 0.0)) ** 2)

    @property
    def half_widths_rad_s(self) -> Array:
        """``(E^-1)_ii^(1/2)``."""
        return np.sqrt(np.diag(np.linalg.inv(self.E_s2)))

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


def check_steps(limits: Sequence[RateLimit], named: tuple[str, object], inertia_kg_m2: Array,
                max_torque_n_m: Array | None, step_s: float) -> None:
    """Refuse limits with which a step may leave the principal branch, or may not exist.

    The guarantee is ``h |J omega| + h^2/2 |tau| < lambda_min(J)``; axes without a limit do not
    count here, the solver guards them. ``named`` is a rate limit, for the error.

    Raises ConfigurationError.
    """
    angle = step_s * min((limit.largest_rate_rad_s for limit in limits), default=0.0)
    if angle >= MAX_STEP_ANGLE_RAD:
        raise ConfigurationError(
            *named, f'limits with step_s * |largest rate| below {MAX_STEP_ANGLE_RAD} rad '
            f'(it is {angle:.4g} rad with step_s = {step_s:g})')
    torque = np.zeros(3) if max_torque_n_m is None else np.where(
        np.isfinite(max_torque_n_m), max_torque_n_m, 0.0)
    momentum = min((limit.largest_momentum_n_m_s(inertia_kg_m2) for limit in limits), default=0.0)
    impulse = step_s * float(np.linalg.norm(torque)) / 2.0
    smallest = float(np.linalg.eigvalsh(inertia_kg_m2)[0])
    reached = step_s * (momentum + impulse)
    if reached >= smallest:
        key, value = named if momentum >= impulse else ('max_torque_n_m', torque.tolist())
        raise ConfigurationError(
            key, value,
            'limits with step_s * |J max_rate| + step_s^2/2 * |max_torque| below the smallest '
            f'moment of inertia {smallest:.4g} kg m^2 (it is {reached:.4g})')


def rate_margins(limits: Sequence[RateLimit], inertia_kg_m2: Array,
                 max_torque_n_m: Array | None, step_s: float) -> list[Margins]:
    """Return by which part each limit, kept at the nodes, has to be smaller to be kept by a body.

    Of a rigid body in continuous time under a torque that is constant over a step. Empty where
    torque or rate of an axis is not limited, and where the step is too long for a bound.
    """
    none: list[Margins] = [{} for _ in limits]
    rate = np.min([np.full(3, np.inf), *(limit.half_widths_rad_s for limit in limits)], axis=0)
    if max_torque_n_m is None or not np.isfinite([rate, max_torque_n_m]).all():
        return none
    bounds = _beyond_nodes(inertia_kg_m2, max_torque_n_m, rate, step_s)
    if bounds is None:
        return none
    parts = [[limit.used_at_most(bound) for bound in bounds] for limit in limits]
    margins = [{name: off[name] + bulge[name] for name in off} for off, bulge in parts]
    return margins if all(part < 1.0 for each in margins for part in each.values()) else none


def _beyond_nodes(J: Array, torque: Array, rate: Array, h: float) -> tuple[Array, Array] | None:
    """Return D and beta / 4 (3,) [rad/s] of docs/theory.md (31), None where they do not exist.

    ``rate`` and ``torque`` (3,) are the half widths of the boxes of rates and torques.
    """
    inverse = np.linalg.inv(J)
    across = np.cross(J[:, None], np.eye(3))  # J e_j x e_k; J is symmetric
    G = np.abs(np.einsum('il,jkl->ijk', inverse, across + across.swapaxes(0, 1)) / 2.0)
    N, turn = h * G @ rate, h * float(np.linalg.norm(rate))
    if turn > 1.0 or np.abs(np.linalg.eigvals(N)).max() >= 1.0:
        return None
    q = np.tan(np.arcsin(turn) / 2.0) ** 2
    change = np.minimum(h * np.abs(inverse) @ torque + (1.0 + q) * N @ rate, 2.0 * rate)
    bend = h * (G @ change) @ change
    beta = np.linalg.solve(np.eye(3) - N / 3.0, N @ change + bend / 6.0)
    off = np.linalg.solve(np.eye(3) - N, bend / 12.0 + q * N @ rate + N @ beta / 3.0)
    return off, beta / 4.0
