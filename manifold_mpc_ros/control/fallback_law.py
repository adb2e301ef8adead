# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The law that takes over when there is no plan: a saturated geometric law on SO(3) or S^2.

With the error angle theta and its unit axis a (body components, the turn from where the body
should be to where it is) and e = 2 sin(theta/2) a, the torque is

    tau = -k e - sat(D omega),
    k = min(lambda_min(J) / (8 h)^2, tau_min / 4),    D = 2 sqrt(k / lambda_min(J)) J,

where sat scales into half of the torque limits, direction kept, and tau_min is the smallest
limit. As |e| <= 2 the sum keeps the limits, and of

    V = omega^T J omega / 2 + 4 k (1 - cos(theta/2)),    dV/dt = -omega^T sat(D omega) <= 0

for every state: no gain, limit or body makes it unstable in continuous time, and D damps every
axis at least critically. From rest the kinetic energy stays below 4 k, so with rate ellipsoids k
is at most a quarter of the largest energy that keeps them; a rate box does not bound it. Above the
existence guard of the implicit step, ``h |J omega| >= lambda_min(J)``, all of the torque brakes:
tau = -J omega / (4 h), scaled into the whole limits. Below it `ConeGuard` has the last word where
there are cones.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import RateEllipsoid
from manifold_mpc_ros.control.actuator import scaled_into
from manifold_mpc_ros.control.cone_guard import BRAKING_STEPS, ConeGuard
from manifold_mpc_ros.dynamics.inertia import existence_guard
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

#: The time constant of turning, in control steps.
TURNING_STEPS = 8.0
#: Part of the smallest torque limit that the attitude may use; the rest brakes.
ATTITUDE_SHARE = 0.5
#: Within this of 180 degrees the side of the turn is kept from call to call [rad].
KEPT_SIDE_RAD = np.deg2rad(10.0)


class FallbackLaw:
    """The saturated law of one body; remembers the side of a half turn from call to call."""

    def __init__(self, config: AttitudeMpcConfig) -> None:
        """Choose the gains from inertia, step and limits."""
        self._inertia = config.inertia_kg_m2
        self._step_s = config.step_s
        self._smallest = existence_guard(config.inertia_kg_m2)
        limit = config.max_torque_n_m
        self._limit = np.full(3, np.inf) if limit is None else limit
        self._stiffness_n_m = min(
            self._smallest / (TURNING_STEPS * config.step_s) ** 2,
            ATTITUDE_SHARE * float(np.min(self._limit)) / 2.0,
            *(RateEllipsoid(E).largest_energy_j(self._inertia) / 4.0
              for E in config.rate_ellipsoids_s2))
        self._damping = 2.0 * np.sqrt(self._stiffness_n_m / self._smallest) * self._inertia
        self._braking = self._inertia / (BRAKING_STEPS * config.step_s)
        self._axis_B = None if config.target == 'attitude' else config.pointing_axis_B
        self._guard = ConeGuard(config) if config.cones else None
        self.reset()

    def reset(self) -> None:
        """Forget the side of the turn, and the stop that was begun."""
        self._side_B: Array | None = None
        if self._guard is not None:
            self._guard.reset()

    def beyond_guard(self, omega_BN_B: Array) -> bool:
        """Return whether the implicit step is not guaranteed at this body rate [rad/s]."""
        momentum = self._step_s * self._inertia @ omega_BN_B
        return not float(np.linalg.norm(momentum)) < self._smallest

    def allows(self, R_NB: Array, omega_BN_B: Array, torque_B_n_m: Array,
               directions_N: Mapping[str, Array], relaxed_R_NB: Array | None) -> bool:
        """Return whether a step of a torque takes no cone from this law: `ConeGuard.allows`."""
        return self._guard is None or self._guard.allows(
            R_NB, omega_BN_B, torque_B_n_m, directions_N, relaxed_R_NB=relaxed_R_NB)

    def torque(self, R_NB: Array, omega_BN_B: Array, R_ND: Array,
               directions_N: Mapping[str, Array] | None = None) -> Array:
        """Map a finite state and the commanded attitude to a torque (3,) [N m] in the limits.

        ``directions_N`` (3,) stand in for those of cones, by name.
        """
        if self.beyond_guard(omega_BN_B):
            return -scaled_into(self._braking @ omega_BN_B, self._limit)
        turn = -self._stiffness_n_m * self._error_B(R_NB, R_ND)
        torque = turn - scaled_into(
            self._damping @ omega_BN_B, (1.0 - ATTITUDE_SHARE) * self._limit)
        return torque if self._guard is None else self._guard.keep(
            R_NB, omega_BN_B, torque, directions_N or {})

    def _error_B(self, R_NB: Array, R_ND: Array) -> Array:
        """Return 2 sin(theta/2) a; near 180 degrees on the side of the last call."""
        if self._axis_B is None:
            w, *v = so3.quaternion_from_rotation(so3.attitude_error_B(R_ND, R_NB))
            half_cosine, half_sine = float(w), np.array(v)
        else:
            half_cosine, half_sine = _half_swing(self._axis_B, R_NB.T @ R_ND @ self._axis_B)
        near_half_turn = half_cosine < np.sin(0.5 * KEPT_SIDE_RAD)
        if near_half_turn and self._side_B is not None:
            half_sine = self._kept(half_sine, self._side_B)
        self._side_B = half_sine if near_half_turn else None
        return 2.0 * half_sine

    def _kept(self, half_sine: Array, side_B: Array) -> Array:
        """Return a half turn on the side of the last: one of two, or any about a pointing axis."""
        if self._axis_B is None:
            return half_sine if half_sine @ side_B >= 0.0 else -half_sine
        across = side_B - (side_B @ self._axis_B) * self._axis_B
        return across * (np.linalg.norm(half_sine) / np.linalg.norm(across))


def _half_swing(axis_B: Array, target_B: Array) -> tuple[float, Array]:
    """Return cos(theta/2) and sin(theta/2) a of the swing from the target to a body axis."""
    half_cosine = float(np.sqrt(max(0.0, 0.5 * (1.0 + float(axis_B @ target_B)))))
    normal = np.cross(target_B, axis_B)
    length = float(np.linalg.norm(normal))
    if length < 1e-9 and half_cosine < 0.5:  # opposite: any axis across will do
        normal = np.cross(axis_B, np.eye(3)[int(np.argmin(np.abs(axis_B)))])
        length = float(np.linalg.norm(normal))
    half_sine = float(np.sqrt(max(0.0, 1.0 - half_cosine ** 2)))
    return half_cosine, normal * (half_sine / length if length > 0.0 else 0.0)
