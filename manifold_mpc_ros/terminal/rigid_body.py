# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rigid body that attitude and pointing share: the step f in SO(3) and its torque.

The state's step f is the *free* step of the body, the paper's f_k; it is a unit quaternion
(w, v), and its momentum m = h Pi, ``f J_d - J_d f^T = hat(m)``, is explicit in it (docs/theory.md
(5) with c = v / w):

    m = 2 (w J v + v x J v),       f^T m = 2 (w J v - v x J v)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import RateLimit
from manifold_mpc_ros.dynamics.inertia import existence_guard
from manifold_mpc_ros.dynamics.symbolic import cayley_step
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.lie.symbolic import cayley_quaternion, rotation_from_quaternion
from manifold_mpc_ros.terminal.manifold import Euclidean, Manifold, Product, RotationGroup
from manifold_mpc_ros.terminal.problem import ManifoldProblem

# Where the turn of a step is not guaranteed up to this part of the guard, it is not computed.
_INSIDE = 0.999


class Motion(NamedTuple):
    """The rotation over the step that is being taken, and the body's next free step."""

    turn: ca.SX
    step: ca.SX


class RigidBody:
    """Step, costs and limits of the rotational motion of one configuration."""

    def __init__(self, config: AttitudeMpcConfig) -> None:
        """Keep the constants of a configuration."""
        self._config = config
        self.h = config.step_s
        self.symmetric = config.forcing == 'symmetric'
        self.inertia = np.asarray(config.inertia_kg_m2)
        self.inverse = np.linalg.inv(self.inertia)
        self.guard = existence_guard(self.inertia)
        self.rate_hessian = trace_hessian(config.rate_weight) / self.h ** 2
        self.torque_hessian = trace_hessian(config.torque_weight)
        self.rate_unit, self.torque_unit = natural_units(config)

    def problem(
        self, name: str, errors: Manifold, turned: Callable[[ca.SX, ca.SX], ca.SX],
        error_cost: Callable[[ca.SX], ca.SX],
    ) -> ManifoldProblem:
        """Return the problem of bringing an error that the body turns to its origin, at rest.

        The state is (error, f) in ``errors`` x SO(3), the input tau_B (3,) [N m]. ``turned`` maps
        (error, turn (4,)) over one step and ``error_cost`` is the error's part of L.
        """
        n, config = errors.ambient, self._config

        def step(x: ca.SX, torque: ca.SX) -> ca.SX:
            """Return (error+, f+)."""
            motion = self.motion(x[n:], torque)
            return ca.vertcat(turned(x[:n], motion.turn), motion.step)

        def stage_cost(x: ca.SX, torque: ca.SX) -> ca.SX:
            """Return L."""
            return error_cost(x[:n]) + self.motion_cost(x[n:], torque)

        return ManifoldProblem(
            name=name, states=Product(errors, RotationGroup(scale=self.h)),
            controls=Euclidean(3), step=step, stage_cost=stage_cost,
            terminal_scale=config.terminal_scale,
            state_units=np.array([1.0] * errors.dimension + [self.rate_unit] * 3),
            control_units=np.full(3, self.torque_unit),
            control_limits=config.max_torque_n_m, control_name='torque',
            control_facets=None if config.wheels is None else (
                config.wheels.torques.normals, config.wheels.torques.bounds),
            state_limits={limit.name: self._values_of(limit, n) for limit in config.rate_limits},
            existence=lambda x, torque: self.load(x[n:], torque))

    def momentum(self, step: ca.SX) -> ca.SX:
        """Map a free step (4,) to its m = h Pi (3,)."""
        w, v = step[0], step[1:4]
        turned = self.inertia @ v
        return 2 * (w * turned + ca.cross(v, turned))

    def rate(self, step: ca.SX) -> ca.SX:
        """Map a free step (4,) to omega_BN_B (3,) [rad/s]."""
        return self.inverse @ self.momentum(step) / self.h

    def motion(self, step: ca.SX, torque: ca.SX) -> Motion:
        """Map a free step (4,) and a torque tau_B (3,) over one step, docs/theory.md (3), (4)."""
        pushed, after = self._momenta(step, torque)
        turn = self._step_of(pushed) if self.symmetric else step
        return Motion(turn, self._step_of(self._turned(turn, pushed) + after))

    def load(self, step: ca.SX, torque: ca.SX) -> ca.SX:
        """Return the largest ``|m|`` over lambda_min(J) of the implicit steps of a motion.

        They are the free step itself, the forced step and the next free step; below 1 each of
        them exists, once, on the principal branch (docs/theory.md, section 2). Where the forced
        step is too near to its bound, the next one is left out: the load says enough.
        """
        pushed, after = self._momenta(step, torque)
        sizes = [ca.norm_2(self.momentum(step)), ca.norm_2(pushed)]
        if not self.symmetric:
            sizes.append(ca.norm_2(self._turned(step, pushed) + after))
        else:
            inside = sizes[1] < _INSIDE * self.guard
            solvable = ca.if_else(inside, pushed, 0)
            following = self._turned(self._step_of(solvable), solvable) + after
            sizes.append(ca.if_else(inside, ca.norm_2(following), 0))
        return ca.fmax(ca.fmax(sizes[0], sizes[1]), sizes[2]) / self.guard

    def motion_cost(self, step: ca.SX, torque: ca.SX) -> ca.SX:
        """Return ``tr(Qf (I - f)) / h^2 + tr(u^T R u) / 2``, u = hat(tau)."""
        return (2 * quadratic(self.rate_hessian, step[1:4])
                + quadratic(self.torque_hessian, torque) / 2)

    def _values_of(self, limit: RateLimit, n: int) -> Callable[[ca.SX], ca.SX]:
        """Return a rate limit as a function of the state, whose error part has n entries."""
        return lambda x: ca.vertcat(*limit.values(ca.vertsplit(self.rate(x[n:]))))

    def _momenta(self, step: ca.SX, torque: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return m of the step that is taken, and what the torque adds after it."""
        impulse = self.h ** 2 * torque
        if not self.symmetric:
            return self.momentum(step), impulse
        return self.momentum(step) + impulse / 2, impulse / 2

    def _step_of(self, m: ca.SX) -> ca.SX:
        """Map m (3,) to the quaternion of its step, by the implicit equation."""
        return cayley_quaternion(cayley_step(m, ca.SX(self.inertia), ca.SX(self.inverse)))

    @staticmethod
    def _turned(turn: ca.SX, m: ca.SX) -> ca.SX:
        """Return ``f^T m``."""
        return rotation_from_quaternion(turn).T @ m


def natural_units(config: AttitudeMpcConfig) -> tuple[float, float]:
    """Return units of rate [rad/s] and torque [N m] in which the terminal design is of order one.

    With mean weights ``q theta^2 + r tau^2`` and mean inertia J, the continuous optimum turns at
    the frequency ``w = (q / r)^(1/4) / J^(1/2)``. Where that is slower than the step, the units
    are w and J w^2, in which angle and torque weigh alike whatever the units of inertia, torque
    and cost; where it is faster, the step is the unit of time.
    """
    inertia = float(np.trace(config.inertia_kg_m2)) / 3
    turn, effort = (float(np.trace(trace_hessian(weight))) for weight in (
        config.error_weight, config.torque_weight))
    frequency = min(1 / config.step_s, (turn / effort) ** 0.25 / inertia ** 0.5)
    return frequency, inertia * frequency ** 2


def trace_hessian(weight: Array) -> Array:
    """Map Q (3, 3) to ``tr(Q) I - Q``, the Hessian of ``tr(Q (I - exp(hat x)))`` at zero."""
    return np.trace(weight) * np.eye(3) - weight


def quadratic(weight: Array, v: ca.SX) -> ca.SX:
    """Return ``v . W v``."""
    return ca.dot(v, weight @ v)
