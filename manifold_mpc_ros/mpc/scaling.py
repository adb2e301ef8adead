# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dimensionless form of the optimal control problem and its flat parameter vector.

Units: time ``h``, inertia ``tr(J)/3``, cost ``tr(Qg)/3`` (pointing: ``w/2``). The step becomes 1
and every quantity is of order one for a CubeSat and a space station alike, so tolerances mean the
same for both.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.linalg import block_diag

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import tangent_basis


class Parameters(NamedTuple):
    """The dimensionless problem, symbolic (CasADi) or numeric, in the order of the flat vector.

    ``guard`` is the smallest principal inertia: an implicit step with |m| below it exists. The
    terminal weight and gain act on ``(x, Log f)``, x the rotation vector of the error: for
    pointing the roll-free one about directions across ``pointing_axis``.
    """

    inertia: ca.SX
    inertia_inverse: ca.SX
    attitude_weight: ca.SX
    rate_weight: ca.SX
    torque_hessian: ca.SX
    terminal_weight: ca.SX
    terminal_level: ca.SX
    terminal_gain: ca.SX
    guard: ca.SX
    pointing_axis: ca.SX
    pointing_across: ca.SX


_SHAPES = Parameters(
    inertia=(3, 3), inertia_inverse=(3, 3), attitude_weight=(3, 3), rate_weight=(3, 3),
    torque_hessian=(3, 3), terminal_weight=(6, 6), terminal_level=(1, 1), terminal_gain=(3, 6),
    guard=(1, 1), pointing_axis=(3, 1), pointing_across=(3, 1))
PARAMETERS = sum(rows * columns for rows, columns in _SHAPES)


def _place(name: str) -> int:
    """Return where a block begins in the flat vector."""
    return sum(rows * columns for rows, columns in _SHAPES[:Parameters._fields.index(name)])


#: Places of the terminal level and of the pointing axis in the flat vector.
TERMINAL_LEVEL = _place('terminal_level')
POINTING_AXIS = _place('pointing_axis')


def unpack(flat: ca.SX) -> Parameters:
    """Map the flat vector (PARAMETERS,) to its named blocks (column-major, as CasADi stores)."""
    blocks, start = [], 0
    for rows, columns in _SHAPES:
        blocks.append(ca.reshape(flat[start:start + rows * columns], rows, columns))
        start += rows * columns
    return Parameters(*blocks)


class Scaling(NamedTuple):
    """Units of one configuration: multiply a dimensionless value by its unit to get SI."""

    time_s: float
    torque_n_m: float
    rate_rad_s: float
    cost: float


def scaling_of(config: AttitudeMpcConfig) -> Scaling:
    """Return the units of a configuration."""
    h = config.step_s
    inertia = float(np.trace(config.inertia_kg_m2)) / 3
    # An angle a off the target costs about a^2 in these units.
    cost = (config.pointing_weight / 2 if config.target == 'pointing'
            else float(np.trace(config.attitude_weight)) / 3)
    return Scaling(h, inertia / h ** 2, 1 / h, cost)


def flat_parameters(config: AttitudeMpcConfig, terminal_weight: Array, terminal_gain: Array,
                    level: float) -> Array:
    """Map a configuration and P (n, n), K (3, n), c of its terminal design to the flat vector.

    n = 6, or 5 for pointing: its coordinates across the axis are lifted to rotation vectors.
    """
    unit = scaling_of(config)
    h = unit.time_s
    inertia = config.inertia_kg_m2 / (unit.torque_n_m * h ** 2)
    weight = config.torque_weight
    torque_hessian = np.trace(weight) * np.eye(3) - weight
    basis = tangent_basis(config.pointing_axis_B)
    chart = np.eye(3) if config.target == 'attitude' else basis.T
    to_si = block_diag(chart, unit.rate_rad_s * np.eye(3))
    blocks = Parameters(
        inertia=inertia, inertia_inverse=np.linalg.inv(inertia),
        attitude_weight=config.error_weight / unit.cost,
        rate_weight=config.rate_weight / (h ** 2 * unit.cost),
        torque_hessian=torque_hessian * unit.torque_n_m ** 2 / unit.cost,
        terminal_weight=to_si.T @ terminal_weight @ to_si / unit.cost,
        terminal_level=np.array([level / unit.cost]),
        terminal_gain=terminal_gain @ to_si / unit.torque_n_m,
        guard=np.linalg.eigvalsh(inertia)[:1],
        pointing_axis=config.pointing_axis_B, pointing_across=basis[:, 0])
    return np.concatenate([np.ravel(block, order='F') for block in blocks])
