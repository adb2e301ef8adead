# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies with wheels that know nothing of the predictor: quaternions, Runge-Kutta.

Under a body torque tau and motor torques u,

    q' = q (0, omega) / 2,    J omega' = tau - W u - omega x (J omega + W h_w),    h_w' = u
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array


@dataclass
class Bodies:
    """n bodies of one inertia (3, 3) and wheel axes (3, m): q (n, 4), omega (n, 3), h_w (n, m)."""

    inertia: Array
    wheels: Array
    q: Array
    omega: Array
    momenta: Array

    @classmethod
    def at_rest(cls, inertia: Array, wheels: Array, R_NB: Array) -> Bodies:
        """Return bodies at rest at attitudes (n, 3, 3), their wheels too."""
        n = len(R_NB)
        return cls(inertia, wheels, so3.quaternion_from_rotation(R_NB), np.zeros((n, 3)),
                   np.zeros((n, wheels.shape[1])))

    @property
    def R_NB(self) -> Array:
        """The attitudes (n, 3, 3)."""
        return so3.rotation_from_quaternion(self.q)

    def step(self, torque: Array, motors: Array, h: float) -> None:
        """Move on by h [s] under body torques (n, 3) and motor torques (n, m) [N m]."""
        inverse, m = np.linalg.inv(self.inertia), self.momenta

        def derivative(x: Array, momenta: Array) -> Array:
            q, omega = x[:, :4], x[:, 4:]
            w, v = q[:, :1], q[:, 1:]
            turn = np.hstack([-np.sum(v * omega, axis=1, keepdims=True),
                              w * omega + _cross(v, omega)]) / 2
            stored = omega @ self.inertia + momenta @ self.wheels.T
            total = torque - motors @ self.wheels.T - _cross(omega, stored)
            return np.hstack([turn, total @ inverse])
        x = np.hstack([self.q, self.omega])
        a = derivative(x, m)
        b = derivative(x + h / 2 * a, m + h / 2 * motors)
        c = derivative(x + h / 2 * b, m + h / 2 * motors)
        d = derivative(x + h * c, m + h * motors)
        x = x + h / 6 * (a + 2 * b + 2 * c + d)
        self.q = x[:, :4] / np.linalg.norm(x[:, :4], axis=1, keepdims=True)
        self.omega, self.momenta = x[:, 4:], m + h * motors


def _cross(a: Array, b: Array) -> Array:
    """Return ``a x b`` (n, 3), several times faster than numpy's for a few rows."""
    return np.stack([a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1], a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
                     a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]], axis=1)
