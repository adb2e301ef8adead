# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the body answers: the torque that acts unasked, and how late the asked one acts.

A Kalman filter on the discrete momentum balance. From one measured state to the next, with f the
measured turn of the body and i(D) the impulse of the torques sent from D before the first to D
before the second,

    Pi+ = f^T Pi + (I + f^T)/2 (i(D) + T d),    Pi = J omega measured,

d a random walk (the disturbance torque, body components), D the actuation delay
(`DelayEstimator`). The impulse comes from LGVI steps; with the measured turn the momentum of a
free body is kept exactly. The impulse is taken as uncertain by `IMPULSE_ERROR` of itself and by
what is not known of D: while it turns hard, a body that is not the model is not taken for a
disturbance. With ``filter_state`` the attitude error theta joins Pi and d in the covariance,

    theta+ = f^T theta + T J^-1 (Pi + T d / 2),    R = R_predicted exp(theta),

and measured attitudes correct all three: plans then begin at the filtered state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample, to_ns
from manifold_mpc_ros.control.response.delay_estimator import DelayEstimator
from manifold_mpc_ros.control.torque_history import TorqueHistory, by_lgvi, moved_on
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

#: Standard deviation of an impulse, as a part of it.
IMPULSE_ERROR = 0.03
#: Two states farther apart than this many steps are not compared.
LONGEST_GAP_STEPS = 3.0
#: The disturbance may have drifted for so long before anything is seen [s].
DRIFTED_S = 100.0
#: Part of the torque limits that a disturbance may take.
LARGEST_SHARE = 0.5


@dataclass(frozen=True)
class ResponseSettings:
    """What the observer is told.

    Standard deviations of a measured rate [rad/s] and attitude [rad]; drift of the disturbance
    in a second [N m]; bounds of its components (3,) [N m]; whether plans count on it, and
    whether they begin at the filtered state.
    """

    rate_noise_rad_s: float
    attitude_noise_rad: float
    drift_n_m: float
    max_torque_n_m: Array
    compensate: bool
    filter_state: bool = False


class ResponseObserver:
    """Estimates the disturbance torque and the actuation delay from states and torques sent.

    Arguments
    ---------
    config
        The model: inertia, step, torque limits.
    settings
        Noise, drift, bound.
    declared_delay_s
        The delay that is expected [s].

    """

    def __init__(
        self, config: AttitudeMpcConfig, settings: ResponseSettings, declared_delay_s: float,
    ) -> None:
        """Start with no disturbance and the declared delay."""
        self._config, self._settings = config, settings
        self.delay = DelayEstimator(declared_delay_s, config.step_s)
        limit = np.inf if config.max_torque_n_m is None else LARGEST_SHARE * config.max_torque_n_m
        self._bound = np.minimum(settings.max_torque_n_m, limit)
        self._noise = settings.rate_noise_rad_s ** 2 * config.inertia_kg_m2 @ config.inertia_kg_m2
        self._inverse = np.asarray(np.linalg.inv(config.inertia_kg_m2), dtype=np.float64)
        self._attitude_noise = settings.attitude_noise_rad ** 2 * np.eye(3)
        self._x = np.zeros(6)
        self._P = np.diag([0.0] * 3 + [settings.drift_n_m ** 2 * DRIFTED_S] * 3
                          + [0.0] * 3 * settings.filter_state)
        self.restart()

    def restart(self) -> None:
        """Compare nothing with the latest state; the estimates stay."""
        self._sample: StateSample | None = None

    def take_over(self, other: ResponseObserver) -> None:
        """Go on with the estimates of another observer of the same body."""
        self._x[3:6] = np.clip(other.disturbance_B_n_m, -self._bound, self._bound)
        self._P[3:6, 3:6] = other._P[3:6, 3:6]

    @property
    def disturbance_B_n_m(self) -> Array:
        """The estimate (3,) [N m]."""
        return self._x[3:6].copy()

    @property
    def disturbance_std_n_m(self) -> Array:
        """Its standard deviation (3,) [N m]."""
        return np.sqrt(np.diag(self._P)[3:6])

    @property
    def compensated_B_n_m(self) -> Array:
        """The disturbance (3,) [N m] that plans count on."""
        return self.disturbance_B_n_m if self._settings.compensate else np.zeros(3)

    def state(self, sample: StateSample) -> tuple[Array, Array]:
        """Return attitude and rate [rad/s] of a state, filtered where plans are to begin there."""
        if not self._settings.filter_state or self._sample is not sample:
            return sample.R_NB, sample.omega_BN_B
        return self._R_NB, self._inverse @ self._x[:3]

    def observe(self, sample: StateSample, sent: TorqueHistory, acting_since_ns: int) -> None:
        """Take a state, and what was sent; nothing sent before ``acting_since_ns`` is trusted.

        The estimates are frozen while commands are not those that act, and over gaps.
        """
        before, self._sample = self._sample, sample
        if before is not None and sample.stamp_ns == before.stamp_ns:
            return
        begin_ns = None if before is None else (
            before.stamp_ns - to_ns(self.delay.measured_s))
        gap_s = 0.0 if before is None else (sample.stamp_ns - before.stamp_ns) / NANOSECONDS
        measured = self._config.inertia_kg_m2 @ sample.omega_BN_B
        if (before is None or begin_ns is None or begin_ns < acting_since_ns
                or not 0.0 < gap_s <= LONGEST_GAP_STEPS * self._config.step_s):
            self._begin(sample, measured)
            return
        try:
            self._predict(before, sample, sent)
        except StepExistenceError:
            self._begin(sample, measured)
            return
        self._correct(slice(0, 3), measured - self._x[:3], self._noise)
        if self._settings.filter_state:
            self._correct(slice(6, 9), so3.log(self._R_NB.T @ sample.R_NB), self._attitude_noise)

    def _begin(self, sample: StateSample, momentum: Array) -> None:
        """Take the state as measured; what is known of the rest stays."""
        self._R_NB = sample.R_NB
        self._x[:3] = momentum
        if self._settings.filter_state:
            self._P[6:, :] = self._P[:, 6:] = 0.0
            self._P[6:, 6:] = self._attitude_noise
        self._P[:3, :] = self._P[:, :3] = 0.0
        self._P[:3, :3] = self._noise

    def _predict(self, before: StateSample, sample: StateSample, sent: TorqueHistory) -> None:
        """Move estimate and covariance on to the time of a state."""
        config, delay, gap_ns = self._config, self.delay, sample.stamp_ns - before.stamp_ns
        gap_s, d, was = gap_ns / NANOSECONDS, self._x[3:].copy(), self._x[:3].copy()
        back = sample.R_NB.T @ before.R_NB
        halfway, F = 0.5 * (np.eye(3) + back), np.eye(len(self._P))
        F[:3, :3], F[:3, 3:6] = back, gap_s * halfway
        if self._settings.filter_state:
            F[6:, 6:], F[6:, :3] = back, gap_s * self._inverse
            F[6:, 3:6] = 0.5 * gap_s ** 2 * self._inverse
        self._P = F @ self._P @ F.T
        impulses = sent.impulses(-delay.delays_s, gap_s, before.stamp_ns) @ halfway.T
        unexplained = (config.inertia_kg_m2 @ sample.omega_BN_B - back @ was
                       - gap_s * halfway @ d)
        first_ns = before.stamp_ns - to_ns(delay.measured_s)
        R_NB, omega_BN_B = moved_on(
            before.R_NB, np.asarray(np.linalg.solve(config.inertia_kg_m2, was), dtype=np.float64),
            ((lasting_ns, torque + d) for lasting_ns, torque in sent.between(
                first_ns, first_ns + gap_ns)), by_lgvi(config))
        self._x[:3] = sample.R_NB.T @ R_NB @ config.inertia_kg_m2 @ omega_BN_B
        self._R_NB = self._R_NB @ before.R_NB.T @ R_NB
        self._blur(gap_s, impulses)
        delay.observe(unexplained - impulses, float(np.trace(self._P[:3, :3] + self._noise)) / 3.0)

    def _blur(self, gap_s: float, impulses: Array) -> None:
        """Add to the covariance what the model does not know."""
        settings, delay, P = self._settings, self.delay, self._P
        near = int(np.argmin(np.abs(delay.delays_s - delay.measured_s)))
        P[range(3), range(3)] += (
            IMPULSE_ERROR ** 2 * impulses[near] @ impulses[near]
            + 2.0 * settings.attitude_noise_rad ** 2 * self._x[:3] @ self._x[:3])
        likely = np.exp(-0.5 * ((delay.delays_s - delay.measured_s) / delay.std_s) ** 2)
        spread = impulses - impulses[near]
        P[:3, :3] += np.einsum('n,ni,nj->ij', likely / likely.sum(), spread, spread)
        P[range(3, 6), range(3, 6)] += settings.drift_n_m ** 2 * gap_s

    def _correct(self, part: slice, off: Array, noise: Array) -> None:
        """Take into account by how much a part of the state is off (3,), with its noise (3, 3)."""
        gain = np.linalg.solve(self._P[part, part] + noise, self._P[part, :]).T
        change = gain @ off
        self._x += change[:6]
        self._P -= gain @ self._P[part, :]
        self._P = 0.5 * (self._P + self._P.T)
        self._x[3:] = np.clip(self._x[3:], -self._bound, self._bound)
        if self._settings.filter_state:
            self._R_NB = self._R_NB @ so3.exp(change[6:])
