# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Controllers for campaigns that need no optimiser, and ones that are broken on purpose.

In a module of their own, as worker processes import them.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution

PLANNED = 12


@dataclass
class Answer:
    torque_B_n_m: Array
    R_NB: Array
    cost: float
    status: str = 'converged'
    searched: bool = False
    iterations: int = 1
    solve_time_s: float = 1e-3


class Damping:
    """A textbook law whose "plan" is the eigenaxis turn, and whose "value" is made up."""

    def __init__(self, gain: float = 0.5) -> None:
        self.gain, self.ticks, self.resets = gain, 0, 0

    def reset(self) -> None:
        self.ticks, self.resets = 0, self.resets + 1

    def solve(self, R_NB: Array, omega_BN_B: Array, R_ND: Array) -> Answer:
        self.ticks += 1
        phi = so3.log(so3.attitude_error_B(R_ND, R_NB))
        turn = so3.exp(np.linspace(0.0, -1.0, PLANNED)[:, None] * phi)
        return Answer(-self.gain * phi - 1.2 * omega_BN_B, R_NB @ turn,
                      cost=1e3 * float(phi @ phi + omega_BN_B @ omega_BN_B) + 100.0 / self.ticks,
                      searched=self.ticks == 1)


class Undecided(Damping):
    """Applies nothing and plans to turn the other way at every tick."""

    def solve(self, R_NB: Array, omega_BN_B: Array, R_ND: Array) -> Answer:
        answer = super().solve(R_NB, omega_BN_B, R_ND)
        if self.ticks % 2:
            phi = so3.log(so3.attitude_error_B(R_ND, R_NB))
            other = phi * (1.0 - 2.0 * np.pi / np.linalg.norm(phi))
            answer.R_NB = R_NB @ so3.exp(np.linspace(0.0, -1.0, PLANNED)[:, None] * other)
        return replace(answer, torque_B_n_m=np.zeros(3))


class Thrower(Damping):
    """Raises at its third case."""

    def solve(self, R_NB: Array, omega_BN_B: Array, R_ND: Array) -> Answer:
        if self.resets == 3:
            raise ValueError('the third is too much')
        return super().solve(R_NB, omega_BN_B, R_ND)


class Dying(Damping):
    """Ends its process."""

    def reset(self) -> None:
        os._exit(3)


class DyingOnce(Damping):
    """Ends its process at its second case, the first time of all."""

    def reset(self) -> None:
        super().reset()
        mark = Path(os.environ['DYING_ONCE_MARK'])
        if self.resets == 2 and not mark.exists():
            mark.touch()
            os._exit(3)


class FlippedFirst:
    """The optimiser, but its first torque is applied with the wrong sign."""

    def __init__(self, mpc: AttitudeMpc) -> None:
        self.mpc, self.first = mpc, True

    def reset(self) -> None:
        self.mpc.reset()
        self.first = True

    def solve(self, R_NB: Array, omega_BN_B: Array, R_ND: Array) -> AttitudeMpcSolution:
        answer = self.mpc.solve(R_NB, omega_BN_B, R_ND)
        sign, self.first = -1.0 if self.first else 1.0, False
        return answer._replace(torque_B_n_m=sign * answer.torque_B_n_m)


def make_damping(_config: AttitudeMpcConfig, _backend: str) -> Damping:
    return Damping()


def make_undecided(_config: AttitudeMpcConfig, _backend: str) -> Undecided:
    return Undecided()


def make_thrower(_config: AttitudeMpcConfig, _backend: str) -> Thrower:
    return Thrower()


def make_dying_once(_config: AttitudeMpcConfig, _backend: str) -> DyingOnce:
    return DyingOnce()


def make_dying(_config: AttitudeMpcConfig, _backend: str) -> Dying:
    return Dying()
