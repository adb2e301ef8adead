# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the body will be when a torque that is sent now begins to act."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.control.body_watch import BodyWatch
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.input_gate import StateSample, to_ns
from manifold_mpc_ros.control.modes import ACTING, Mode
from manifold_mpc_ros.control.response.known_torque import known_torque_B
from manifold_mpc_ros.control.torque_history import TorqueHistory, by_lgvi, moved_on
from manifold_mpc_ros.lie.arrays import Array

#: Torques sent are kept for the longest delay and so many steps.
KEPT_STEPS = 6
_NEVER_NS = 2 ** 63
#: Of the torque limits plans count on no more than this part.
LARGEST_PART = 0.9


class Anticipation:
    """The torques sent, and what the law's observer says of the torque and the delay to come.

    ``body`` watches whether the body that answers is the model's.
    """

    def __init__(self, law: Law) -> None:
        """Start with no torque sent."""
        self._sent = TorqueHistory(0)
        self._mode, self._acting_since_ns = Mode.WAIT, _NEVER_NS
        self._law = law
        #: Torque (3,) of dipoles that is planned for this tick [N m], None without any.
        self.dipole_torque_B_n_m: Array | None = None
        #: What is known to act unasked at the latest state (3,) [N m], None where nothing is.
        self.known_B_n_m: Array | None = None
        self.take(law)

    def take(self, law: Law) -> None:
        """Work for this law from now on, with the estimates so far."""
        delay_s = law.actuation_delay_s
        if law.observer is not None:
            delay_s = law.observer.delay.longest_s
            if self._law.observer is not None:
                law.observer.take_over(self._law.observer)
        self._sent.kept_ns = to_ns(delay_s + KEPT_STEPS * law.config.step_s)
        self._law = law
        self.body = BodyWatch(law.config, to_ns(law.actuation_delay_s))

    def restart(self) -> None:
        """Compare no state with those so far."""
        self.body.restart()
        if self._law.observer is not None:
            self._law.observer.restart()

    def see(self, sample: StateSample | None) -> None:
        """Take the latest state into account, if there is one."""
        if sample is None:
            return
        known = self._law.known
        self.known_B_n_m = None if known is None else known_torque_B(
            known, sample.stamp_ns, sample.R_NB)
        if self._law.observer is not None:
            self._law.observer.observe(sample, self._sent, self._acting_since_ns)

    def watch(self, sample: StateSample | None) -> None:
        """Compare how the body answers with the model, once the command is on its way."""
        if sample is not None:
            self.body.observe(sample, self._sent, self._acting_since_ns)

    def send(self, time_ns: int, mode: Mode, acting_B_n_m: Array) -> None:
        """Note the torque (3,) [N m] that is sent in a mode; our own are those of acting modes."""
        if mode not in ACTING:
            self._acting_since_ns = _NEVER_NS
        elif self._mode not in ACTING:
            self._acting_since_ns = time_ns
        self._mode = mode
        self._sent.record(time_ns, acting_B_n_m if self.known_B_n_m is None else (
            acting_B_n_m + self.known_B_n_m))

    @property
    def _estimated_B_n_m(self) -> Array | None:
        """The torque (3,) [N m] that acts unasked, None where nobody looks for one."""
        return None if self._law.observer is None else self._law.observer.compensated_B_n_m

    @property
    def disturbance_B_n_m(self) -> Array | None:
        """What plans count on beside their own torque (3,) [N m].

        That, the torque of dipoles, and what is known; None where there is none of them.
        """
        parts = [each for each in (
            self._estimated_B_n_m, self.dipole_torque_B_n_m, self.known_B_n_m)
            if each is not None]
        if not parts:
            return None
        total, limit = np.sum(parts, axis=0), self._law.config.max_torque_n_m
        if self.known_B_n_m is None or limit is None:
            return np.asarray(total)
        return np.clip(total, -LARGEST_PART * limit, LARGEST_PART * limit)

    @property
    def delay_ns(self) -> int:
        """The delay that plans are made for [ns]."""
        law = self._law
        return to_ns(law.actuation_delay_s if law.observer is None else law.observer.delay.delay_s)

    @property
    def planned_disturbance_B_n_m(self) -> Array:
        """The same, zero where there is none."""
        planned = self.disturbance_B_n_m
        return np.zeros(3) if planned is None else planned

    def state_when_acting(
        self, sample: StateSample, time_ns: int, age_ns: int,
    ) -> tuple[Array, Array]:
        """Return attitude and rate when a torque that is sent at ``time_ns`` begins to act.

        The state is moved on by its age and the actuation delay, under the torques that were
        sent in that time, one delay earlier.

        Raises StepExistenceError where the implicit step is not guaranteed.
        """
        disturbance = self._estimated_B_n_m
        torques = self._sent.between(time_ns - age_ns - self.delay_ns, time_ns)
        if disturbance is not None:
            torques = ((lasting_ns, torque + disturbance) for lasting_ns, torque in torques)
        observer = self._law.observer
        state = (sample.R_NB, sample.omega_BN_B) if observer is None else observer.state(sample)
        return moved_on(*state, torques, self._law.advance or by_lgvi(self._law.config))
