# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The torque box ``|u_i| <= max_torque_i``, hard; about a disturbance torque where one acts."""

from __future__ import annotations

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import Zonotope
from manifold_mpc_ros.mpc.program.field import Field, Memory
from manifold_mpc_ros.mpc.program.phase import Read
from manifold_mpc_ros.mpc.scaling import Array, Scaling
from manifold_mpc_ros.mpc.stages import barrier
from manifold_mpc_ros.mpc.stages.inequality import TorqueInequality, dimensionless_limits

# An offset nearer to the facets leaves the solver no room: it is then taken for this near.
LARGEST_OFFSET = 0.8


class TorqueBox(TorqueInequality):
    """Values ``+-u_i / max_torque_i - 1``, upper ones first; data: max_torque (3,) first."""

    name = 'torque_box'

    data_size = 3

    @classmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return 6, or 0 without torque limits."""
        return 0 if config.max_torque_n_m is None else 6

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return the dimensionless limits."""
        return dimensionless_limits(config.max_torque_n_m, unit.torque_n_m)

    def values(self, read: Read, u: ca.SX) -> ca.SX:
        """Return v (6,)."""
        return barrier.box(u, self._limit(read))

    def slope(self, read: Read, du: ca.SX) -> ca.SX:
        """Return ``dv/du du`` (6,)."""
        ratio = du / self._limit(read)
        return ca.vertcat(ratio, -ratio)

    def gradient(self, read: Read, pull: ca.SX) -> ca.SX:
        """Return ``(dv/du)^T pull`` (3,)."""
        return barrier.box_transpose(pull, self._limit(read))

    def hessian(self, read: Read, weight: ca.SX) -> ca.SX:
        """Return the diagonal (3,) of ``(dv/du)^T diag(weight) dv/du``."""
        return barrier.box_hessian(weight, self._limit(read))

    def _limit(self, read: Read) -> ca.SX:
        """Return max_torque (3,)."""
        return read(self.data)

    def box(self, read: Read) -> ca.SX:
        """Return max_torque (3,)."""
        return self._limit(read)

    def inside(self, read: Read, u: ca.SX, margin: ca.SX) -> ca.SX:
        """Return the torque clipped to ``(margin_lower - 1, 1 - margin_upper)`` of the limits."""
        limit = self._limit(read)
        ratio = ca.fmin(ca.fmax(u / limit, margin[3:6] - 1), 1 - margin[0:3])
        return ratio * limit


class ShiftedTorqueBox(TorqueBox):
    """``|u_i - d_i| <= max_torque_i``, u the net torque, d the disturbance; data: both (3,)."""

    name = 'shifted_torque_box'

    data_size = 6

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return the dimensionless limits, and no disturbance."""
        return np.concatenate([super().numbers(config, unit), np.zeros(3)])

    def values(self, read: Read, u: ca.SX) -> ca.SX:
        """Return v (6,)."""
        return super().values(read, u - self._disturbance(read))

    def inside(self, read: Read, u: ca.SX, margin: ca.SX) -> ca.SX:
        """Return the torque moved inside by relative margins (6,)."""
        d = self._disturbance(read)
        return d + super().inside(read, u - d, margin)

    def box(self, read: Read) -> ca.SX:
        """Return ``max_torque - |d|`` (3,)."""
        return self._limit(read) - ca.fabs(self._disturbance(read))

    def _limit(self, read: Read) -> ca.SX:
        """Return max_torque (3,)."""
        return read(self.data)[0:3]

    def _disturbance(self, read: Read) -> ca.SX:
        """Return d (3,)."""
        return read(self.data)[3:6]


class TorquePolytope(TorqueInequality):
    """``|a_f . (u - d)| <= 1`` for each facet f of what reaction wheels give.

    a_f is its normal over its bound; u - d is what the motors have to make, d a disturbance less
    the gyroscopic torque of the stored momentum. Values ``+-a_f . (u - d) - 1``, upper ones first;
    data: A (m, 3), d (3), and half widths (3) of a box inside, about zero.
    """

    name = 'torque_polytope'

    def __init__(self, rows: int) -> None:
        """Make the fields."""
        super().__init__(rows)
        self.cross: Field = Field('torque_weight_cross', 3, Memory.MODEL)

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields that it adds to the solver's memory."""
        return (*super().fields, self.cross)

    @property
    def data_size(self) -> int:
        """Three numbers a facet pair, the offset, the box."""
        return 3 * self.rows // 2 + 6

    @classmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return the number of facets, 0 without wheels."""
        return 0 if config.wheels is None else 2 * len(config.wheels.normals)

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return the dimensionless numbers without an offset."""
        assert config.wheels is not None
        return self.numbers_of(config.wheels.torques, np.zeros(3), unit)

    def numbers_of(self, torques: Zonotope, offset: Array, unit: Scaling) -> Array:
        """Return the dimensionless numbers of a zonotope with as many facets, or fewer [N m]."""
        facets = torques.normals / torques.bounds[:, None]
        facets = np.pad(facets, ((0, self.rows // 2 - len(facets)), (0, 0)), 'edge')
        size = float(np.abs(facets @ offset).max())
        held = offset * min(1.0, LARGEST_OFFSET / size) if size > 0.0 else offset
        box = torques.box * (1.0 - min(size, LARGEST_OFFSET))
        return np.concatenate([np.ravel(facets * unit.torque_n_m, order='F'),
                               held / unit.torque_n_m, box / unit.torque_n_m])

    def _facets(self, read: Read) -> ca.SX:
        """Return A (m, 3)."""
        return ca.reshape(read(self.data)[:-6], self.rows // 2, 3)

    def _offset(self, read: Read) -> ca.SX:
        """Return A d (m,)."""
        return self._facets(read) @ read(self.data)[-6:-3]

    def values(self, read: Read, u: ca.SX) -> ca.SX:
        """Return v (rows,)."""
        ratio = self._facets(read) @ (u - read(self.data)[-6:-3])
        return ca.vertcat(ratio - 1, -ratio - 1)

    def slope(self, read: Read, du: ca.SX) -> ca.SX:
        """Return ``dv/du du`` (rows,)."""
        ratio = self._facets(read) @ du
        return ca.vertcat(ratio, -ratio)

    def gradient(self, read: Read, pull: ca.SX) -> ca.SX:
        """Return ``(dv/du)^T pull`` (3,)."""
        half = self.rows // 2
        return self._facets(read).T @ (pull[:half] - pull[half:])

    def _full(self, read: Read, weight: ca.SX) -> ca.SX:
        """Return ``(dv/du)^T diag(weight) dv/du`` (3, 3)."""
        half, facets = self.rows // 2, self._facets(read)
        return facets.T @ ca.diag(weight[:half] + weight[half:]) @ facets

    def hessian(self, read: Read, weight: ca.SX) -> ca.SX:
        """Return the diagonal (3,) of ``(dv/du)^T diag(weight) dv/du``."""
        return ca.diag(self._full(read, weight))

    def crossed(self, read: Read, weight: ca.SX) -> dict[Field, ca.SX]:
        """Return the rest of it: entries xy, xz, yz."""
        full = self._full(read, weight)
        return {self.cross: ca.vertcat(full[0, 1], full[0, 2], full[1, 2])}

    def box(self, read: Read) -> ca.SX:
        """Return the half widths (3,)."""
        return read(self.data)[-3:]

    def inside(self, read: Read, u: ca.SX, margin: ca.SX) -> ca.SX:
        """Return the torque scaled down to relative margins (rows,)."""
        along, offset = self._facets(read) @ u, self._offset(read)
        along, room = ca.vertcat(along, -along), 1 - margin + ca.vertcat(offset, -offset)
        most = ca.mmax(ca.vertcat(*(along[i] / room[i] for i in range(self.rows))))
        return u / ca.fmax(1, most)
