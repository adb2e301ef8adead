# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a body torque to the motor torques of reaction wheels, and back.

A body with wheels of momenta h_w (absolute, about their axes) keeps ``Pi + W h_w`` but for
turning, so wheels of motor torques u act on it, over a step that turns it by f = cay(c), as the
body torque of the symmetric step

    tau = -2/h c x (W h_w) - (I + c^x) W u,    c = h/2 omega_mid,

the gyroscopic torque of the stored momentum included (docs/theory.md (25)). The rate in the
middle of the step is predicted to the first order, which leaves an error of the third in momentum.
"""

from __future__ import annotations

import itertools
from copy import copy

import numpy as np
from scipy.optimize import linprog, lsq_linear

from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.lie.so3 import hat

# Wheels apart by this part of their capacity keep from zero speed.
_BIAS = 0.3
# A null space motion takes this many steps.
_NULL_STEPS = 10.0
# A wheel beyond this part of its momentum is relieved by the others, in so many steps.
_CROWDED, _RELIEF_STEPS = 0.7, 3.0
# Of the room that is left for a plan so much is used: what comes next differs a little.
_KEPT = 0.8
# A motor at its momentum limit keeps this part of its torque, so that ratios are numbers, and the
# limit is taken this part lower, so that it is kept all the same.
_LEAST_PART, _ROOM = 1e-9, 1e-6
# A demand beyond the limits by less is scaled into them.
_ROUNDING = 1e-9


class WheelAllocation:
    """Motor torques of one array in one state, for the body torque of a step.

    Arguments
    ---------
    wheels
        The array; wheels that are not available get no torque.
    inertia_kg_m2
        J (3, 3) of the body without the wheels' inertia about their axes.
    step_s
        Time h for which motor torques are held [s].
    omega_BN_B
        Body rate (3,) at its begin [rad/s].
    momentum_n_m_s
        Momentum h_w (n,) of every wheel at its begin [N m s].
    torque_B_n_m
        The body torque tau (3,) that is asked for [N m].

    """

    def __init__(self, wheels: WheelArray, inertia_kg_m2: Array, step_s: float,
                 omega_BN_B: Array, momentum_n_m_s: Array, torque_B_n_m: Array,
                 ) -> None:
        """Find the turn of the step, and the limits of motors: their own, and of momentum."""
        self._wheels, self._h, self._momentum = wheels, step_s, momentum_n_m_s
        self._torque = torque_B_n_m
        rising = np.linalg.solve(inertia_kg_m2, torque_B_n_m - (
            hat(omega_BN_B) @ inertia_kg_m2 @ omega_BN_B))
        middle = omega_BN_B + step_s / 2 * rising
        self._turned = np.eye(3) + hat(step_s / 2 * middle)
        self._gyroscopic = hat(middle) @ wheels.axes_B.T @ momentum_n_m_s
        top, room = wheels.max_torque_n_m, (1.0 - _ROOM) * wheels.max_momentum_n_m_s
        least = _LEAST_PART * top
        self.low = -np.clip((room + momentum_n_m_s) / step_s, least, top) * wheels.available
        self.high = np.clip((room - momentum_n_m_s) / step_s, least, top) * wheels.available

    def demand(self, part: float = 1.0) -> Array:
        """Return the ``W u`` (3,) that gives this part of the torque [N m]."""
        return np.asarray(np.linalg.solve(
            self._turned, -part * self._torque - self._gyroscopic))

    def realised(self, motor_n_m: Array) -> Array:
        """Map motor torques (n,) to the body torque (3,) that they give [N m]."""
        return -self._gyroscopic - self._turned @ (self._wheels.matrix @ motor_n_m)

    def part(self) -> float:
        """Return the largest s <= 1 with ``s tau`` among what the wheels can give now.

        1 where no such s is, which the gyroscopic torque alone may cause.
        """
        rest, whole = self.demand(0.0), self.demand()
        centre, reach = self._facets()
        along, slope = (self._wheels.normals @ each for each in (rest, whole - rest))
        room = np.concatenate([reach + centre - along, reach - centre + along])
        slope = np.concatenate([slope, -slope])
        with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
            ends = room / slope
        least = np.max(ends, where=slope < 0.0, initial=0.0)
        most = np.min(ends, where=slope > 0.0, initial=1.0)
        beyond = least > most or bool((room[slope == 0.0] < 0.0).any())
        return 1.0 if beyond else float(most)

    def _facets(self) -> tuple[Array, Array]:
        """Return ``n . W centre`` and the reach from it, of every facet normal n."""
        normals, W = self._wheels.normals, self._wheels.matrix
        along = normals @ W
        return (along @ (self.low + self.high)) / 2, np.abs(along) @ (self.high - self.low) / 2

    def motor_torques(self, part: float = 1.0, planned_n_m: Array | None = None) -> Array:
        """Return motor torques (n,) within their limits for this part of the torque [N m].

        ``W u`` is the demand to rounding where it is among what the wheels can give, else the
        nearest that they can. The null space is that of ``planned_n_m`` (n,), as far as the limits
        leave room; without it the largest part of its limit that a motor uses is the least
        possible, but for what the null space is used for, and for wheels that are nearly full.
        """
        motor = self._most(part)
        if planned_n_m is not None:
            return motor + self._null_motion(motor, planned_n_m - motor)
        parts = np.abs(self._momentum) / self._wheels.max_momentum_n_m_s
        if float(np.max(parts, where=self._wheels.available, initial=0.0)) > _CROWDED:
            return motor + self._towards(motor, self._balanced(), _RELIEF_STEPS)
        return motor + self._for_purpose(motor)

    def leading_into(self, room: Array, part: float = 1.0) -> Array:
        """Return such motor torques (n,) [N m] of four wheels with nu in ``room`` (2,) after them.

        As far as the limits let it; ``room`` is the interval of `null_room` after the step. What
        the null space is used for is done inside.
        """
        motor, line = self._most(part), self._wheels.null_basis[:, 0]
        wanted = motor + self._for_purpose(motor)
        after = float(line @ (self._momentum + self._h * wanted))
        kept = room.mean() + _KEPT * (room - room.mean())
        return motor + self._null_motion(
            motor, wanted - motor + (float(np.clip(after, *kept)) - after) / self._h * line)

    def _most(self, part: float) -> Array:
        """Return the least motor torques (n,) for a part of the torque, within the limits."""
        demand = self.demand(part)
        motor = self._least(demand)
        with np.errstate(divide='ignore', invalid='ignore'):
            parts = np.where(motor > 0.0, motor / self.high, motor / self.low)
        largest = max(1.0, float(np.max(parts, where=motor != 0.0, initial=0.0)))
        return motor / largest if largest < 1.0 + _ROUNDING else self._nearest(demand)

    def _nearest(self, demand: Array) -> Array:
        """Return motor torques (n,) within the limits with the least ``|W u - demand|``."""
        used, size = self._wheels.available, float(np.abs(demand).max())
        motor = np.zeros(len(self._wheels))
        motor[used] = np.clip(size * lsq_linear(
            self._wheels.matrix[:, used], demand / size,
            (self.low[used] / size, self.high[used] / size), 'bvls').x,
            self.low[used], self.high[used])
        return motor

    def _for_purpose(self, motor: Array) -> Array:
        """Return the motor torques (n,) beside ``motor`` that the null space is for."""
        purpose = self._wheels.null_space
        if purpose == 'least_torque' or not self._wheels.null_basis.size:
            return 0.0 * motor
        return self._towards(motor, self._apart() if purpose == 'away_from_zero'
                             else self._balanced(), _NULL_STEPS)

    def _least(self, demand: Array) -> Array:
        """Return u with ``W u = demand`` and the least s of ``s low <= u <= s high``.

        Or some u beyond the limits.
        """
        W, n = self._wheels.matrix, len(self._wheels)
        used = np.flatnonzero(self._wheels.available)
        if len(used) == 3:
            motor = np.zeros(n)
            motor[used] = np.linalg.solve(W[:, used], demand)
            return motor
        if len(used) == 4:
            return self._least_of_line(
                self._wheels.inverse @ demand, self._wheels.null_basis[:, 0])
        scale = self._wheels.max_torque_n_m[used]
        size = float(np.abs(demand).max()) or 1.0
        k = len(used)
        limits = np.block([[np.eye(k), -(self.high[used] / scale)[:, None]],
                           [-np.eye(k), (self.low[used] / scale)[:, None]]])
        found = linprog(np.append(np.zeros(k), 1.0), A_ub=limits, b_ub=np.zeros(2 * k),
                        A_eq=np.hstack([W[:, used] * scale, np.zeros((3, 1))]) / size,
                        b_eq=demand / size, bounds=[(None, None)] * k + [(0, None)])
        if found.x is None:  # a wheel that is full has next to no room on one side
            return self._wheels.inverse @ demand
        motor = np.zeros(n)
        motor[used] = scale * found.x[:k]
        return motor + self._wheels.inverse @ (demand - W @ motor)

    def _least_of_line(self, motor: Array, line: Array) -> Array:
        """Return the least of ``motor + y line``: the lowest crossing of its linear pieces."""
        used = self._wheels.available
        limits = np.concatenate([self.high[used], self.low[used]])
        begin, slope = (np.tile(each[used], 2) / limits for each in (motor, line))
        with np.errstate(divide='ignore', invalid='ignore'):
            y = (begin[:, None] - begin) / (slope - slope[:, None])
        y = y[np.isfinite(y)]
        largest = np.max(begin + np.multiply.outer(y, slope), axis=1)
        return motor + float(y[np.argmin(largest)]) * line

    def _towards(self, motor: Array, wanted: Array, steps: float) -> Array:
        """Return motor torques (n,) that turn nothing and lead momenta there in so many steps."""
        return self._null_motion(motor, (wanted - self._momentum) / (steps * self._h))

    def _null_motion(self, motor: Array, wanted: Array) -> Array:
        """Return what of motor torques (n,) turns nothing, within the limits beside ``motor``."""
        basis = self._wheels.null_basis
        change = basis @ (basis.T @ wanted)
        with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
            room = np.where(change > 0.0, self.high - motor, self.low - motor) / change
        return change * float(np.clip(np.min(room, where=change != 0.0, initial=1.0), 0.0, 1.0))

    def _apart(self) -> Array:
        """Return momenta (n,) that turn nothing, all of them far from zero, on the side of now."""
        used, room = self._wheels.available, self._wheels.max_momentum_n_m_s
        basis = self._wheels.null_basis
        ratios = [basis @ np.array(signs) / room for signs in itertools.product(
            (1.0, -1.0), repeat=basis.shape[1])]
        apart = max(ratios, key=lambda each: float(np.abs(each[used]).min()))
        side = -1.0 if float(apart @ self._momentum) < 0.0 else 1.0
        return np.asarray(side * _BIAS / np.abs(apart).max() * apart * room)

    def _balanced(self) -> Array:
        """Return momenta (n,) of the same sum, the largest relative one the least possible."""
        wheels = self._wheels
        still = copy(self)
        still.high = wheels.max_momentum_n_m_s * wheels.available
        still.low = -still.high
        return still._least(wheels.matrix @ self._momentum)
