# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States on which the exported controller is compared with Python's: closed loops of all kinds."""

from __future__ import annotations

import numpy as np
from strategies import generator, half_turns
from targets import python_answer

from manifold_mpc_ros import AttitudeMpc
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

KINDS = ('half turn', 'random', 'tumbling', 'beyond the limits', 'disturbed', 'new targets')


def quaternion(R: Array) -> Array:
    """Return (x, y, z, w) of a rotation."""
    w, x, y, z = so3.quaternion_from_rotation(R)
    return np.array([x, y, z, w])


class Extras:
    """What one loop gives beside its states: momenta of wheels, directions, a reference.

    Wheels store up to 0.3 of their limits and keep the momentum of all; in every third loop one
    of four or more is silent from tick 5 on. In every second loop directions of cones move, and
    in two of three the target does, at up to 0.3 of the rate limit.
    """

    def __init__(self, mpc: AttitudeMpc, loop: int, rng: np.random.Generator, rate: float,
                 moving: bool) -> None:
        """Draw them."""
        self._config, self._silent = mpc.config, None
        self._moves, self._tracks = loop % 2 == 1, moving and loop % 3 != 0
        self._turn = 0.03 * rng.uniform(-1, 1, 3)
        self._spin = 0.3 * rate * rng.uniform(-1, 1, 3)
        self._from = so3.random_rotations(rng, 1)[0]
        self._moving, wheels = moving, mpc.config.wheels
        if wheels is not None:
            self._momentum = 0.3 * wheels.max_momentum_n_m_s * rng.uniform(-1, 1, len(wheels))
            self._silent = int(rng.integers(len(wheels))) if (
                loop % 3 == 2 and len(wheels) > 3) else None

    def at(self, tick: int, R_NB: Array, omega: Array) -> Array:
        """Return the rest of the record of a state."""
        config, parts = self._config, []
        n, tracks = config.horizon + 1, self._tracks
        moves = self._moves and len(config.cones) > 0
        times = config.step_s * (tick + np.arange(n))[:, None]
        if config.wheels is not None:
            stored = config.wheels.axes_B.T @ self._momentum + config.inertia_kg_m2 @ omega
            if tick == 0:
                self._total_N = R_NB @ stored
            change = R_NB.T @ self._total_N - stored
            momentum = self._momentum = self._momentum + config.wheels.inverse @ change
            if self._silent is not None and tick >= 5:
                momentum = np.where(np.arange(len(momentum)) == self._silent, np.nan, momentum)
            parts.append(momentum)
        for cone in config.cones:
            parts.append(np.array([unit(each) for each in so3.exp(times * self._turn)
                                   @ cone.direction_N]))
        directions = np.stack(parts[-len(config.cones):], axis=1).ravel() if config.cones else []
        momenta = parts[0] if config.wheels is not None else []
        path = so3.exp(times * self._spin) @ self._from
        reference = [] if not self._moving else np.concatenate([
            *map(quaternion, path), np.tile(self._from.T @ self._spin, n)])
        return np.concatenate([[moves, tracks], momenta, directions, reference])


def unit(direction: Array) -> Array:
    """Return about this direction, of a length that normalising does not change any more."""
    while True:
        direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        if np.linalg.norm(direction, axis=-1) == 1.0:
            return direction
        direction = direction + 1e-12 * np.arange(1, 4)  # some would go to and fro


def loops(mpc: AttitudeMpc, count: int, ticks: int, key: str, *, moving: bool = False,
          late_s: float = 0.0) -> tuple[Array, Array]:
    """Return states (n, record) of closed loops on the predictions, and answers (n, 11).

    Under the last torque for ``late_s`` before each is answered.
    """
    rng, config = generator(key), mpc.config
    states, answers = [], []
    rate = 0.3 if config.max_rate_rad_s is None else float(np.min(config.max_rate_rad_s))
    torque = 0.0 if config.max_torque_n_m is None else config.max_torque_n_m
    for loop in range(count):
        kind = KINDS[loop % len(KINDS)]
        R = so3.random_rotations(rng, 1)[0]
        if kind == 'half turn':
            R = half_turns(np.eye(3)[rng.integers(3)]) if rng.random() < 0.5 else half_turns(R[0])
        spread = {'half turn': 0.0, 'tumbling': 0.9, 'beyond the limits': 1.5}.get(kind, 0.3)
        omega, target = spread * rate * rng.uniform(-1, 1, 3), np.eye(3)
        disturbance = 0.2 * torque * rng.uniform(-1, 1, 3) * (kind == 'disturbed')
        extras = Extras(mpc, loop, np.random.default_rng(loop), rate, moving)
        torque_before = np.zeros(3)
        for tick in range(ticks):
            if kind == 'new targets' and tick % 7 == 3:
                target = so3.random_rotations(rng, 1)[0]
            state = np.concatenate([[tick == 0], quaternion(R), omega, quaternion(target),
                                    disturbance * np.ones(3), extras.at(tick, R, omega)])
            state = np.insert(state, 17, [late_s, *torque_before, loop % 4 == 1])
            plan, answer = python_answer(mpc, state)
            states.append(state)
            answers.append(answer)
            if plan.status == 'failed':
                break
            R, omega, torque_before = plan.R_NB[1], plan.omega_BN_B[1], plan.torque_B_n_m
            if kind == 'tumbling':
                omega = omega + 0.05 * rate * rng.uniform(-1, 1, 3)
    return np.array(states), np.array(answers)
