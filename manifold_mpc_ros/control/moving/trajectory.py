# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A commanded attitude that moves, as a function of time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.control.input_gate import NANOSECONDS, to_ns
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.reference import Reference

#: Part of an interval over which the derivative of the rotation vector's rate is a difference.
DIFFERENCE = 1e-4
#: A moving setpoint turns by no more than this from one point of its trajectory to the next [rad].
LARGEST_TURN_RAD = 1.0


class Trajectory:
    """Attitudes through points with rates and accelerations, interpolated on SO(3).

    From point k to k + 1, T apart, the rotation vector phi of ``R_k^T R(t)`` is the polynomial of
    degree five whose value, rate and acceleration at both ends are those of the points,

        phi' = J_r(phi)^-1 omega,    phi'' = d/dt (J_r(phi)^-1 omega),    omega = J_r(phi) phi',

    so attitude, rate and acceleration are continuous. Before the first point its attitude is
    commanded, at rest; so is that of the end from ``until_ns`` on, or from the last point.

    Arguments
    ---------
    times_ns
        Of the points (m,), growing [ns].
    R_ND, omega_DN_D, alpha_DN_D
        Attitudes (m, 3, 3), and in the axes D of the target rates (m, 3) [rad/s] and
        accelerations (m, 3) [rad/s^2]; None: differences of the rates.
    until_ns
        From when on it counts as over [ns]; plans before that see all of it. None: the last point.

    """

    moves = True

    def __init__(
        self, times_ns: NDArray[np.int64], R_ND: Array, omega_DN_D: Array,
        alpha_DN_D: Array | None = None, until_ns: int | None = None,
    ) -> None:
        """Make the polynomials."""
        self._begin_ns, last_ns = int(times_ns[0]), int(times_ns[-1])
        self._until_ns, self._stale = last_ns if until_ns is None else until_ns, until_ns
        self._s: Array = (times_ns - self._begin_ns) / NANOSECONDS
        self._R, self._omega = R_ND, omega_DN_D
        if alpha_DN_D is None:
            alpha_DN_D = np.zeros_like(omega_DN_D) if len(R_ND) == 1 else np.gradient(
                omega_DN_D, self._s, axis=0, edge_order=2 if len(R_ND) > 2 else 1)
        self._moves_at_end = bool(omega_DN_D[-1].any())
        self._powers = self._polynomials(np.diff(self._s)[:, None], alpha_DN_D)

    @classmethod
    def at_rate(
        cls, begin_ns: int, R_ND: Array, omega_DN_D: Array, *, valid_s: float,
        seen_s: float,
    ) -> Trajectory:
        """Return a setpoint that keeps its rate for ``valid_s``; plans see it ``seen_s`` on."""
        seen_s += valid_s
        count = 2 + int(float(np.linalg.norm(omega_DN_D)) * seen_s / LARGEST_TURN_RAD)
        s = np.linspace(0.0, seen_s, count)
        return cls(begin_ns + np.round(s * NANOSECONDS).astype(np.int64),
                   R_ND @ so3.exp(s[:, None] * omega_DN_D), np.tile(omega_DN_D, (count, 1)),
                   until_ns=begin_ns + to_ns(valid_s))

    def _polynomials(self, T: Array, alpha: Array) -> Array:
        """Return the coefficients of phi in t / T (m - 1, 6, 3) of the intervals' lengths [s]."""
        end = so3.log(np.swapaxes(self._R[:-1], 1, 2) @ self._R[1:]).reshape(-1, 3)

        def rate(phi: Array, omega: Array) -> Array:
            return (so3.right_jacobian_inverse(phi) @ omega[..., None])[..., 0]

        omega, d = self._omega[1:], DIFFERENCE * T
        v1 = rate(end, omega)
        a1 = (rate(end + d * v1, omega + d * alpha[1:])
              - rate(end - d * v1, omega - d * alpha[1:])) / (2.0 * d)
        v0, a0, v1, a1 = T * self._omega[:-1], T ** 2 * alpha[:-1], T * v1, T ** 2 * a1
        p, v, a = end - v0 - a0 / 2.0, v1 - v0 - a0, a1 - a0
        return np.stack([np.zeros_like(end), v0, a0 / 2.0, 10.0 * p - 4.0 * v + a / 2.0,
                         -15.0 * p + 7.0 * v - a, 6.0 * p - 3.0 * v + a / 2.0], axis=1)

    def over(self, time_ns: int) -> bool:
        """Return whether it is over at a time [ns]."""
        return time_ns >= self._until_ns

    def at(self, time_ns: int) -> tuple[Array, Array]:
        """Return R_ND (3, 3) and omega_DN_D (3,) [rad/s] at a time [ns]."""
        R_ND, omega = self._evaluate(np.array([self._seconds(time_ns)]))
        return R_ND[0], np.zeros(3) if self.over(time_ns) else omega[0]

    def over_horizon(self, time_ns: int, step_s: float, steps: int) -> Reference:
        """Return attitudes and rates at so many steps from a time [ns], both ends included."""
        if self.over(time_ns):
            return Reference.fixed(self.at(time_ns)[0], steps)
        begin_s = self._seconds(time_ns)
        return Reference(*self._evaluate(
            np.linspace(begin_s, begin_s + steps * step_s, steps + 1)))

    def warning(self, time_ns: int) -> str:
        """Say that it is over although it should go on."""
        if not (self.over(time_ns) and self._moves_at_end):
            return ''
        what = 'reference ended while it moved' if self._stale is None else 'setpoint is stale'
        ago_s = (time_ns - self._until_ns) / NANOSECONDS
        return f'the {what}, {ago_s:.3g} s ago: its last attitude is held'

    def _seconds(self, time_ns: int) -> float:
        """Return the time since the first point [s], no later than the end."""
        return (min(time_ns, self._until_ns) - self._begin_ns) / NANOSECONDS

    def _evaluate(self, s: Array) -> tuple[Array, Array]:
        """Return attitudes (n, 3, 3) and rates (n, 3) so long after the first point (n,) [s]."""
        ends = self._s
        resting = (s < 0.0) | (s >= ends[-1]) if len(ends) > 1 else np.ones(len(s), dtype=bool)
        k = np.clip(np.searchsorted(ends, s, side='right') - 1, 0, max(len(ends) - 2, 0))
        if len(ends) == 1:
            return self._R[k], np.zeros((len(s), 3))
        T = (ends[k + 1] - ends[k])[:, None]
        x = np.clip((s - ends[k])[:, None] / T, 0.0, 1.0)
        powers = x[:, :, None] ** np.arange(6)
        phi = (powers @ self._powers[k])[:, 0]
        speed = ((np.arange(1, 6) * powers[:, :, :5]) @ self._powers[k][:, 1:])[:, 0] / T
        omega = (so3.right_jacobian(phi) @ speed[..., None])[..., 0]
        return self._R[k] @ so3.exp(phi), np.where(resting[:, None], 0.0, omega)
