# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The torques already sent, by the time of their ticks, and how they move a state on."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie.arrays import Array

_NONE = np.zeros(3)
#: Maps attitude, rate [rad/s], a torque (3,) [N m] and how long it acts [s] to the state then;
#: raises StepExistenceError where the implicit step is not guaranteed.
Advance = Callable[[Array, Array, Array, float], tuple[Array, Array]]


class TorqueHistory:
    """A torque as a function of the time that it was sent, piecewise constant, 0 at first.

    Arguments
    ---------
    kept_ns
        How long before the latest torque the function is known [ns].

    """

    def __init__(self, kept_ns: int) -> None:
        """Start with no torque sent."""
        self.kept_ns = kept_ns
        self._sent: deque[tuple[int, Array]] = deque()

    def record(self, time_ns: int, torque_B_n_m: Array) -> None:
        """Note that a torque (3,) [N m] was sent; what was sent later than now is void."""
        while self._sent and self._sent[-1][0] >= time_ns:
            self._sent.pop()
        self._sent.append((time_ns, torque_B_n_m))
        while len(self._sent) > 1 and self._sent[1][0] <= time_ns - self.kept_ns:
            self._sent.popleft()

    def between(self, begin_ns: int, end_ns: int) -> Iterator[tuple[int, Array]]:
        """Return the torques (3,) [N m] from begin to end, each with its duration [ns]."""
        torque = _NONE
        for sent_ns, following in self._sent:
            if begin_ns < sent_ns < end_ns:
                yield sent_ns - begin_ns, torque
                begin_ns = sent_ns
            if sent_ns < end_ns:
                torque = following
        if begin_ns < end_ns:
            yield end_ns - begin_ns, torque

    def impulses(self, begins_s: Array, lasting_s: float, epoch_ns: int) -> Array:
        """Return the impulses (n, 3) [N m s] over windows of this length, begun after an epoch."""
        if not self._sent:
            return np.zeros((len(begins_s), 3))
        times = np.array([sent_ns - epoch_ns for sent_ns, _ in self._sent]) / NANOSECONDS
        times = np.append(times, max(times[-1], float(np.max(begins_s)) + lasting_s) + lasting_s)
        torques = np.array([torque for _, torque in self._sent])
        sums = np.vstack([np.zeros(3), np.cumsum(np.diff(times)[:, None] * torques, axis=0)])
        return np.stack([
            np.interp(begins_s + lasting_s, times, total) - np.interp(begins_s, times, total)
            for total in sums.T], axis=1)


def by_lgvi(config: AttitudeMpcConfig) -> Advance:
    """Return what moves a state on in LGVI steps, none longer than that of the controller."""
    def advance(R_NB: Array, omega_BN_B: Array, torque_B_n_m: Array, lasting_s: float
                ) -> tuple[Array, Array]:
        steps = math.ceil(lasting_s / config.step_s)
        for _ in range(steps):
            R_NB, omega_BN_B = lgvi_step(
                R_NB, omega_BN_B, torque_B_n_m, inertia_kg_m2=config.inertia_kg_m2,
                step_s=lasting_s / steps)
        return R_NB, omega_BN_B

    return advance


def moved_on(
    R_NB: Array, omega_BN_B: Array, torques: Iterable[tuple[int, Array]], advance: Advance,
) -> tuple[Array, Array]:
    """Return attitude and rate [rad/s] after torques (3,) [N m], each with its duration [ns].

    Raises StepExistenceError where the implicit step is not guaranteed.
    """
    for lasting_ns, torque_B_n_m in torques:
        R_NB, omega_BN_B = advance(R_NB, omega_BN_B, torque_B_n_m, lasting_ns / NANOSECONDS)
    return R_NB, omega_BN_B
