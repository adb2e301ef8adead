# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A reference that moves over the horizon, and what it uses of the limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import Margins, RateLimit
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program.options import ROTATION_DEFECT

#: Of the limits, a reference leaves this part at least to the solver: less is not followed.
LEAST_SHARE = 1e-2


@dataclass(frozen=True, eq=False)
class Reference:
    """Commanded attitudes and rates at the nodes of the horizon, k = 0..N.

    Arguments
    ---------
    R_ND
        Attitudes (N+1, 3, 3), reference to inertial components.
    omega_DN_D
        Rates of the reference in its own axes (N+1, 3) [rad/s].

    Raises ConfigurationError for other shapes, and for what is not finite or no rotation.

    """

    R_ND: Array
    omega_DN_D: Array

    def __post_init__(self) -> None:
        """Check both."""
        R_ND, omega = (np.array(value, dtype=float) for value in (self.R_ND, self.omega_DN_D))
        if R_ND.ndim != 3 or R_ND.shape[1:] != (3, 3) or omega.shape != (len(R_ND), 3):
            raise ConfigurationError('reference', (R_ND.shape, omega.shape),
                                     'arrays (N+1, 3, 3) and (N+1, 3)')
        defect = np.abs(np.swapaxes(R_ND, 1, 2) @ R_ND - np.eye(3)).max(initial=0.0)
        if not (np.isfinite(omega).all() and defect <= ROTATION_DEFECT
                and (np.linalg.det(R_ND) > 0.0).all()):
            raise ConfigurationError('reference', f'defect {defect:.3g}',
                                     'finite rates and rotations')
        object.__setattr__(self, 'R_ND', R_ND)
        object.__setattr__(self, 'omega_DN_D', omega)

    @classmethod
    def fixed(cls, R_ND: Array, horizon: int) -> Reference:
        """Return the reference that stays at an attitude (3, 3)."""
        return cls(np.tile(R_ND, (horizon + 1, 1, 1)), np.zeros((horizon + 1, 3)))

    def rolled(self, axis_B: Array, R_NB: Array) -> Reference:
        """Return the same directions of an axis (3,), with the roll about it of a body (3, 3).

        Where roll is free, rates are compared in the axes that the body has, not in others.
        """
        w, *v = so3.quaternion_from_rotation(self.R_ND[0].T @ R_NB)
        roll = so3.exp(2.0 * np.arctan2(np.array(v) @ axis_B, w) * axis_B)
        return Reference(self.R_ND @ roll, self.omega_DN_D @ roll)


def reference_torque(reference: Reference, config: AttitudeMpcConfig) -> Array:
    """Return the torques (N, 3) [N m] that make the momenta of a reference.

    The LGVI's momentum balance with the reference's own steps F_k = R_k^T R_{k+1}: symmetric
    forcing ``Pi_{k+1} = F_k^T (Pi_k + h/2 tau) + h/2 tau``, the paper's ``F_k^T Pi_k + h tau``.
    """
    momenta = reference.omega_DN_D @ config.inertia_kg_m2
    back = np.swapaxes(reference.R_ND[1:], 1, 2) @ reference.R_ND[:-1]
    change = momenta[1:] - (back @ momenta[:-1, :, None])[..., 0]
    h = config.step_s
    if config.forcing != 'symmetric':
        return change / h
    return np.asarray(np.linalg.solve(h / 2 * (np.eye(3) + back), change[..., None])[..., 0])


def used_by(end: Reference, config: AttitudeMpcConfig, disturbance_B_n_m: Array
            ) -> tuple[Array, float]:
    """Return the torque (3,) [N m] between two nodes, and the part of the limits that is used."""
    torque = reference_torque(end, config)[0]
    limit = np.inf if config.max_torque_n_m is None else config.max_torque_n_m
    used = (np.abs(torque) + np.abs(disturbance_B_n_m)) / limit
    limits = zip(config.planned.rate_limits, reference_margins(config), strict=True)
    return torque, max([float(used.max()), *(
        _rate_share(each, end.omega_DN_D, margin) for each, margin in limits)])


def reference_margins(config: AttitudeMpcConfig) -> list[Margins]:
    """Return what plans about targets that move keep to the limits of the terminal set.

    Which may have the margin in them already.
    """
    planned = config.planned
    return config.rate_margins if planned is config else [{} for _ in planned.rate_limits]


def _rate_share(limit: RateLimit, omega: Array, margin: Margins) -> float:
    """Return the largest part of a limit that rates (n, 3) [rad/s] and its margin use."""
    return max((float(np.max(part)) + margin.get(name, 0.0)
                for name, part in limit.used(omega).items()), default=0.0)
