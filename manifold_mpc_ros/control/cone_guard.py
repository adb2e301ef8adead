# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cones without a plan: a torque is let through while the body can still stop clear of them.

A *stop* is a path of the model: a constant torque for some steps, then braking to rest along the
momentum, both within the torque limits and scaled into what reaction wheels give; the torque gives
way to braking where it would add momentum beyond a rate limit. Its cost is the sum, over the steps
of a fixed time, of the angle by which the tightened cones, where they will be then, are violated
(docs/theory.md, section 13). Of the stops

    the torque that is wanted for one step; braking at once; the rest of the last stop;
    1, 2, 4, 8, 16 steps of the largest torque in each of 26 directions

the first with the least cost is begun. At the next tick its rest is one of them again, so where
one of cost zero is found once, no tightened cone is violated at a step from there on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from manifold_mpc_ros.config.cones import Cone, joined, tightened
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import rates_beyond
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie.arrays import Array

#: The time constant of braking, in steps.
BRAKING_STEPS = 4.0
#: A stop is followed for this many steps at most, and is at rest when less is left to turn [rad].
LONGEST_STOP, AT_REST_RAD = 200, 1e-4
#: Costs within this of each other are equal [rad].
EQUAL_RAD = 1e-4
_SWERVES = (1, 2, 4, 8, 16)
_DIRECTIONS = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1.0


class _Stops(NamedTuple):
    """Torques (n, 3) [N m] and for how many steps (n,) each lasts before the body brakes."""

    torques_B_n_m: Array
    steps: Array


class ConeGuard:
    """Knows the stops of one body; remembers the rest of the last one from call to call."""

    def __init__(self, config: AttitudeMpcConfig) -> None:
        """Take the cones as the optimiser keeps them; there is at least one."""
        assert config.max_torque_n_m is not None  # as cones need it
        self._config, self._cones = config, config.kept_cones
        self._limit = config.max_torque_n_m
        self._wheels = None if config.wheels is None else config.wheels.torques
        self._inverse = np.asarray(np.linalg.inv(config.inertia_kg_m2), dtype=np.float64)
        self._braking = config.inertia_kg_m2 / (BRAKING_STEPS * config.step_s)
        self._swerves = _Stops(np.tile(_DIRECTIONS * self._limit, (len(_SWERVES), 1)),
                               np.repeat(_SWERVES, len(_DIRECTIONS)))
        self.reset()

    def reset(self) -> None:
        """Forget the stop that was begun."""
        self._rest = _Stops(np.zeros((1, 3)), np.zeros(1))

    def allows(self, R_NB: Array, omega_BN_B: Array, torque_B_n_m: Array,
               directions_N: Mapping[str, Array], *, relaxed_R_NB: Array | None = None) -> bool:
        """Return whether to stop after a step of a torque costs nothing, or no more than at once.

        ``relaxed_R_NB`` (N + 1, 3, 3), nodes of a plan that could not keep every limit: the cones
        as they are given count, as it is held off by tightened ones, or leaves them. While
        directions move, nodes that keep those are enough: the body need not rest where a cone
        will come.
        """
        relaxed, moving = relaxed_R_NB is not None, any(s.ndim == 2 for s in directions_N.values())
        cones = self._config.cones if relaxed else self._kept(directions_N)
        if relaxed and moving and _least_rad(cones, relaxed_R_NB, directions_N).min() >= 0.0:
            return True
        torque, brake = self._costs(
            R_NB, omega_BN_B, _Stops(np.array([torque_B_n_m, np.zeros(3)]), np.array([1.0, 0.0])),
            directions_N, cones)
        return bool(torque <= max(EQUAL_RAD, brake))

    def keep(self, R_NB: Array, omega_BN_B: Array, torque_B_n_m: Array,
             directions_N: Mapping[str, Array]) -> Array:
        """Map the torque that is wanted to that of the best stop (3,) [N m]."""
        stops, cones = _Stops(torque_B_n_m[None], np.ones(1)), self._kept(directions_N)
        costs = self._costs(R_NB, omega_BN_B, stops, directions_N, cones)
        if costs[0] > EQUAL_RAD:
            stops = _Stops(*map(np.concatenate, zip(
                _Stops(np.array([torque_B_n_m, np.zeros(3)]), np.array([1.0, 0.0])),
                self._rest, self._swerves)))
            costs = self._costs(R_NB, omega_BN_B, stops, directions_N, cones)
        best = int(np.flatnonzero(costs <= costs.min() + EQUAL_RAD)[0])
        chosen = _Stops(stops.torques_B_n_m[[best]], stops.steps[[best]])
        self._rest = _Stops(chosen.torques_B_n_m, chosen.steps - 1.0)
        return self._torques(omega_BN_B[None], chosen, 0)[0]

    def _kept(self, directions_N: Mapping[str, Array]) -> tuple[Cone, ...]:
        """Return the cones that are kept between steps too, while directions (N + 1, 3) move."""
        moved = [np.linalg.norm(np.diff(np.atleast_2d(directions_N[each.name]), axis=0),
                                axis=1).max(initial=0.0) if each.name in directions_N else 0.0
                 for each in self._cones]
        return self._cones if not any(moved) else tightened(
            self._config.cones, self._config.between_samples, moved)

    def _costs(self, R_NB: Array, omega_BN_B: Array, stops: _Stops,
               directions_N: Mapping[str, Array], cones: Sequence[Cone]) -> Array:
        """Return the cost of each stop (n,) by these cones [rad]."""
        n = len(stops.steps)
        R, omega = np.tile(R_NB, (n, 1, 1)), np.tile(omega_BN_B, (n, 1))
        cost, inside, step_s = np.zeros(n), np.zeros(n), self._config.step_s
        last = max([stops.steps.max(), *(
            len(each) - 1 for each in directions_N.values() if each.ndim == 2)])
        for step in range(LONGEST_STOP):
            left = BRAKING_STEPS * step_s * np.abs(omega).max()
            if step >= last and left < AT_REST_RAD:
                return cost + (LONGEST_STOP - step) * inside
            R, omega = lgvi_step(R, omega, self._torques(omega, stops, step),
                                 inertia_kg_m2=self._config.inertia_kg_m2, step_s=step_s)
            inside = np.maximum(0.0, -_least_rad(cones, R, {
                name: _at(each, step + 1) for name, each in directions_N.items()}))
            cost += inside
        return cost

    def _torques(self, omega_BN_B: Array, stops: _Stops, step: int) -> Array:
        """Return the torques (n, 3) [N m] of a step at rates (n, 3) [rad/s]."""
        brake = omega_BN_B @ self._braking
        brake *= -1.0 / np.maximum(1.0, np.max(np.abs(brake) / self._limit, axis=1))[:, None]
        J = self._config.inertia_kg_m2
        before = omega_BN_B @ J
        after = before + self._config.step_s * stops.torques_B_n_m
        faster = np.linalg.norm(after, axis=1) > np.linalg.norm(before, axis=1)
        beyond = rates_beyond(self._config.rate_limits, after @ self._inverse, 0.0)
        brakes = (step >= stops.steps) | (beyond & faster)
        torques = np.where(brakes[:, None], brake, stops.torques_B_n_m)
        if self._wheels is not None:
            parts = np.abs(torques @ self._wheels.normals.T) / self._wheels.bounds
            torques /= np.maximum(1.0, np.max(parts, axis=1))[:, None]
        return torques


def _least_rad(cones: Sequence[Cone], R_NB: Any, directions_N: Mapping[str, Array]) -> Array:
    """Map attitudes (n, 3, 3), directions (n, 3) or (3,) to the least margins (n,) [rad]."""
    margins = np.array([cone.margins_rad(R_NB, directions_N.get(cone.name)) for cone in cones])
    return np.asarray(np.min(list(joined(cones, margins).values()), axis=0))


def _at(direction_N: Array, node: int) -> Array:
    """Return the direction (3,) at a node: of (3,) itself, of (N + 1, 3) the last beyond N."""
    return direction_N if direction_N.ndim == 1 else np.asarray(
        direction_N[min(node, len(direction_N) - 1)])
