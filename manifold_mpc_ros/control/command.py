# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the control loop works with, and what comes out of it at each tick."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.orbit import KnownTorque
from manifold_mpc_ros.control.actuator import Actuation
from manifold_mpc_ros.control.consistency import MotionBounds
from manifold_mpc_ros.control.decrease_monitor import FIXED, DecreaseMonitor
from manifold_mpc_ros.control.decrease_record import Allowance, DecreaseRecord
from manifold_mpc_ros.control.devices.magnetorquers import DipoleLaw
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.moving.promise import MovingPromise
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.control.response.observer import ResponseObserver
from manifold_mpc_ros.control.solver_thread import SolverRunner
from manifold_mpc_ros.control.target import Target
from manifold_mpc_ros.control.torque_history import Advance
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.reference import Reference
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution


@dataclass(frozen=True)
class Command:
    """One decided command: finite, within the limits, and why it is what it is.

    ``stamp_ns`` is the stamp of the state that it answers [ns]; ``source`` says where the torque
    comes from: 'mpc', 'plan', 'fallback' or 'zero'.
    """

    stamp_ns: int
    actuation: Actuation
    mode: Mode
    reason: str
    source: str = 'zero'
    solution: AttitudeMpcSolution | None = None
    decrease: DecreaseRecord | None = None

    @property
    def torque_B_n_m(self) -> Array:
        """The body torque (3,) that is asked of the actuator [N m]."""
        return self.actuation.torque_B_n_m


@dataclass(frozen=True)
class Law:
    """A control law that is ready to work: its configuration, its solver, and who judges it.

    A torque begins to act ``actuation_delay_s`` after the tick that it is sent at; ``observer``
    estimates by how much that is wrong, and the disturbance torque.
    An attitude error that stays above ``largest_steady_error_rad`` is worth a warning.
    ``moving`` says what plans about targets that move promise; None: as about fixed ones.
    ``motion``: within what attitude and rate have to tell of one motion; None: not compared.
    ``dipoles``: what magnetorquers are commanded; None without them. ``known``: torque that acts
    unasked and is known; None without any.
    ``slews`` puts profiles in the place of setpoints that jump; None: they are aimed at.
    ``advance`` moves a state on; None: the LGVI does.
    """

    config: AttitudeMpcConfig
    solver: SolverRunner
    timeout_s: float
    monitor: DecreaseMonitor | None = None
    backend: str = ''
    actuation_delay_s: float = 0.0
    motion: MotionBounds | None = None
    observer: ResponseObserver | None = None
    largest_steady_error_rad: float = math.inf
    dipoles: DipoleLaw | None = None
    moving: MovingPromise | None = None
    slews: SlewPlanner | None = None
    known: KnownTorque | None = None
    advance: Advance | None = None

    def allowance(
        self, solution: AttitudeMpcSolution | None, target: Target | None, acting_ns: int,
        disturbance_B_n_m: Array,
    ) -> Allowance:
        """Return what the promise of a plan allows for that begins at a time [ns]."""
        config = self.config
        seen = None if target is None or solution is None or self.moving is None else (
            target.over_horizon(acting_ns, config.step_s, config.horizon + 1))
        if seen is None or solution is None or self.moving is None:
            return FIXED
        end = Reference(seen.R_ND[-2:], seen.omega_DN_D[-2:])
        return self.moving.allowance(solution, end, disturbance_B_n_m)

    def judged(self, command: Command, time_s: float, delay_s: float, allowance: Allowance
               ) -> Command:
        """Return the command of a tick at ``time_s`` with what the monitor says about it.

        Its torque acts ``delay_s`` after the tick.
        """
        if self.monitor is None:
            return command
        solution, nominal = command.solution, command.mode is Mode.NOMINAL
        applied = (solution is not None and nominal
                   and command.actuation.realises(solution.torque_B_n_m))
        return replace(command, decrease=self.monitor.observe(
            solution, time_s=time_s, delay_s=delay_s, applied=applied,
            why_none='' if nominal else command.reason, allowance=allowance))
