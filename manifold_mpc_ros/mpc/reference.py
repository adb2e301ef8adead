# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A reference that moves over the horizon, and what the solver needs of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program.options import ROTATION_DEFECT
from manifold_mpc_ros.mpc.rate_margin import Margins, relative
from manifold_mpc_ros.mpc.scaling import scaling_of

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


class ReferenceNumbers(NamedTuple):
    """``nodes`` (N+1, 14): quaternions of E_k = R_D0Dk and F_k, rate and torque, dimensionless.

    ``torque_share`` (3,) is what the reference's torque uses of the torque limits, ``rate_share``
    what its rate uses of the rate limits, both the largest over the horizon; ``rests``: its rate
    at the end is zero, so a law about its end has all the limits.
    """

    nodes: Array
    torque_share: Array
    rate_share: float
    rests: bool


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


def numbers_of_reference(
    reference: Reference, config: AttitudeMpcConfig, margins: list[Margins],
) -> ReferenceNumbers:
    """Map a reference of the horizon's length to the solver's numbers.

    ``margins`` are those that plans keep to rate limits. Raises ConfigurationError for another
    length.
    """
    if len(reference.R_ND) != config.horizon + 1:
        raise ConfigurationError('reference', len(reference.R_ND),
                                 f'{config.horizon + 1} nodes, one more than the horizon')
    unit, omega = scaling_of(config), reference.omega_DN_D
    quaternions = so3.quaternion_from_rotation(reference.R_ND[0].T @ reference.R_ND)
    sides = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0)
    quaternions[1:] *= np.cumprod(sides)[:, None]
    torque = reference_torque(reference, config)
    torque = np.vstack([torque, torque[-1:]])
    limit = np.inf if config.max_torque_n_m is None else config.max_torque_n_m
    half = 0.5 * config.step_s * omega
    angle = np.linalg.norm(half, axis=1, keepdims=True)
    nodes = np.hstack([
        quaternions, np.cos(angle), np.sinc(angle / np.pi) * half,
        omega / unit.rate_rad_s, torque / unit.torque_n_m])
    return ReferenceNumbers(nodes, np.abs(torque).max(axis=0) / limit,
                            _rate_share(config, omega, margins),
                            not omega[-1].any())


def used_by(
    end: Reference, config: AttitudeMpcConfig, margins: list[Margins], disturbance_B_n_m: Array,
) -> tuple[Array, float]:
    """Return the torque (3,) [N m] between two nodes, and the part of the limits that is used."""
    torque = reference_torque(end, config)[0]
    limit = np.inf if config.max_torque_n_m is None else config.max_torque_n_m
    used = (np.abs(torque) + np.abs(disturbance_B_n_m)) / limit
    return torque, max(float(used.max()), _rate_share(config, end.omega_DN_D, margins))


def _rate_share(config: AttitudeMpcConfig, omega: Array, margins: list[Margins]) -> float:
    """Return the largest part of a rate limit that rates (n, 3) [rad/s] and its margin use."""
    return max((float(np.max(ratio)) + margin.get(name, 0.0)
                for limit, margin in zip(config.rate_limits, margins, strict=True)
                for name, ratio in relative(limit, omega).items()), default=0.0)
