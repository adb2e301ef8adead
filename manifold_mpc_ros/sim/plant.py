# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated spacecraft: a rigid body under clipped torque, with disturbances and sensors.

The plant shares the formulas of the LGVI with the predictor and nothing else: it has its own
inertia, its own (smaller) step and always the symmetric forcing, which is second order for a
torque that is held over the step.
"""

from __future__ import annotations

import math
import operator
from collections import deque
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import SimulatorConfig
from manifold_mpc_ros.dynamics import scalar_form
from manifold_mpc_ros.dynamics.environment import dipole_field_N, gravity_gradient_B
from manifold_mpc_ros.dynamics.inertia import existence_guard
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

DisturbanceFrame: TypeAlias = Literal['body', 'inertial']

# A substep uses at most this part of the guard |h Pi + h^2/2 tau| < lambda_min(J): the step
# exists up to 1, and is still accurate at one half (a turn of about 30 degrees).
GUARD_FRACTION = 0.5
# More substeps than this in one step, and the step is not taken at all.
MAX_SUBSTEPS = 1000


@dataclass
class PlantCounters:
    """What has happened to the plant since its last reset, counted in steps."""

    saturated: int = 0   # a commanded torque was beyond a limit on some axis
    refused: int = 0     # a commanded torque was not finite; zero was applied
    substepped: int = 0  # one LGVI step would have passed the guard; several were taken
    frozen: int = 0      # not even MAX_SUBSTEPS were enough; the state was kept


class Plant:
    """A rigid body that answers torque commands, one step of ``config.step_s`` at a time.

    Arguments
    ---------
    config
        Inertia, step, initial state, limits, disturbance, noise and its seed.
    disturbance_frame
        'body': ``config.disturbance_torque_n_m`` is constant in body components (a leaking
        thruster); 'inertial': constant in inertial components, and applied by the same
        trapezoidal rule, so that inertial momentum gains exactly h d in a step.

    Raises ConfigurationError for another disturbance frame.

    """

    #: How many numbers a command has.
    inputs = 3

    def __init__(
        self, config: SimulatorConfig, *, disturbance_frame: DisturbanceFrame = 'body',
    ) -> None:
        """Store the configuration and put the body into its initial state."""
        if disturbance_frame not in ('body', 'inertial'):
            raise ConfigurationError(
                'disturbance_frame', disturbance_frame, "'body' or 'inertial'")
        self.config = config
        self._disturbance = np.array(config.disturbance_torque_n_m, dtype=np.float64)
        self._inertial_disturbance = disturbance_frame == 'inertial'
        self._disturbance_n_m = math.hypot(*self._disturbance.tolist())
        self._inertia_rows = config.inertia_kg_m2.tolist()
        self._smallest_inertia = existence_guard(config.inertia_kg_m2)
        self.reset()

    def reset(self) -> None:
        """Return to the initial state at time zero; counters and noise start again too."""
        x, y, z, w = self.config.initial_attitude_xyzw
        self._R_NB = so3.rotation_from_quaternion([w, x, y, z])
        self._omega_BN_B = np.array(self.config.initial_rate_rad_s, dtype=np.float64)
        self._torque_B = np.zeros(self.inputs)
        self._under_way = deque([np.zeros(self.inputs)] * self.config.delay_steps)
        self._steps = 0
        #: Dipole (3,) of magnetorquers, which acts where there is a field [A m^2].
        self.dipole_B_a_m2 = np.zeros(3)
        self.counters = PlantCounters()
        # One stream each: switching one noise off leaves the other as it was.
        attitude_seed, rate_seed = np.random.SeedSequence(self.config.seed).spawn(2)
        self._attitude_noise = np.random.default_rng(attitude_seed)
        self._rate_noise = np.random.default_rng(rate_seed)

    @property
    def step_s(self) -> float:
        """The time that one call of `step` takes [s]."""
        return self.config.step_s

    @property
    def R_NB(self) -> Array:
        """The true attitude (3, 3), body to inertial."""
        return self._R_NB.copy()

    @property
    def omega_BN_B(self) -> Array:
        """The true body rate (3,) [rad/s]."""
        return self._omega_BN_B.copy()

    @property
    def torque_B_n_m(self) -> Array:
        """The actuator torque (3,) of the last step, after the limits [N m]."""
        return self._torque_B.copy()

    @property
    def time_s(self) -> float:
        """Simulated time since the start or the last reset [s], a multiple of the step."""
        return self._steps * self.config.step_s

    def step(self, tau_B: ArrayLike) -> None:
        """Advance by one plant step under the commanded torque (3,) [N m].

        The torque is clipped axis by axis, as separate actuators do: a command outside the box
        changes its direction. A command that is not finite counts as zero. The disturbance acts
        beyond the limits, and a torque acts ``config.actuation_delay_s`` after its command. The
        state stays finite whatever is commanded, and `counters` tell what was done about it
        (test_plant.py).
        """
        self._under_way.append(self._actuate(np.asarray(tau_B, dtype=np.float64)))
        self._torque_B = self._acting(self._under_way.popleft())
        self._steps += 1
        substeps = self._substeps_needed()
        if substeps == 0:
            self.counters.frozen += 1
            return
        if substeps > 1:
            self.counters.substepped += 1
        for _ in range(substeps):
            self._advance(self.config.step_s / substeps)

    def measure(self) -> tuple[Array, Array]:
        """Return attitude (3, 3) and body rate (3,) [rad/s] as the sensors see them.

        Gaussian noise about each body axis, ``R_NB exp(n)`` and ``omega + n``; without noise
        the true state to the last bit. The seed fixes the whole sequence.
        """
        R_NB, omega_BN_B = self.R_NB, self.omega_BN_B
        if self.config.attitude_noise_std_rad > 0.0:
            R_NB = R_NB @ so3.exp(
                self._attitude_noise.normal(scale=self.config.attitude_noise_std_rad, size=3))
        if self.config.rate_noise_std_rad_s > 0.0:
            omega_BN_B += self._rate_noise.normal(
                scale=self.config.rate_noise_std_rad_s, size=3)
        return R_NB, omega_BN_B

    def _actuate(self, tau_B: Array) -> Array:
        """Return the torque that the actuators give for a command."""
        if tau_B.shape != (self.inputs,) or not all(map(math.isfinite, tau_B.tolist())):
            self.counters.refused += 1
            return np.zeros(self.inputs)
        return self._limited(tau_B)

    def _acting(self, now: Array) -> Array:
        """Return what turns the body of what the actuators give now."""
        return now

    @property
    def usage(self) -> dict[str, float]:
        """What the actuators have used since the last reset, by name."""
        return {}

    def _limited(self, tau_B: Array) -> Array:
        """Return a torque within the limits, others counted."""
        limit = self.config.max_torque_n_m
        if limit is None or all(map(operator.le, map(abs, tau_B.tolist()), limit.tolist())):
            return tau_B.copy()
        self.counters.saturated += 1
        return np.clip(tau_B, -limit, limit)

    def _substeps_needed(self) -> int:
        """Return the number of substeps that keeps each of them inside the guard, 0 for none.

        No substep of h/n starts with more momentum than |Pi| + h |tau| (n-1)/n, and its own
        half step adds h/(2n) |tau|: h/n (|Pi| + h |tau|) bounds what the guard looks at.
        """
        momentum = math.hypot(*scalar_form.apply(self._inertia_rows, self._omega_BN_B.tolist()))
        return self._substeps(momentum, math.hypot(*self._torque_B.tolist())
                              + self._disturbance_n_m)

    def _substeps(self, momentum: float, torque: float) -> int:
        """Return the number of substeps for momenta [N m s] and torques [N m] of these sizes."""
        step_s = self.config.step_s
        needed = step_s * (momentum + step_s * torque) / (GUARD_FRACTION * self._smallest_inertia)
        if not needed <= MAX_SUBSTEPS:
            return 0
        return max(1, math.ceil(needed))

    def _advance(self, step_s: float) -> None:
        """Take one step; torques that depend on the attitude act as the trapezoidal rule says.

        Those of both its ends act, h/2 each: a step holds the value of the begin, so its second
        half is corrected afterwards.
        """
        external_B = self._external_B()
        self._R_NB, omega_BN_B = self._turned(external_B, step_s)
        if self._inertial_disturbance or self.config.orbit is not None:
            turned = self._external_B() - external_B
            omega_BN_B = omega_BN_B + np.linalg.solve(
                self.config.inertia_kg_m2, 0.5 * step_s * turned)
        self._omega_BN_B = omega_BN_B

    def _turned(self, external_B: Array, step_s: float) -> tuple[Array, Array]:
        """Return attitude and rate after one LGVI step under a torque beside the actuators'."""
        return lgvi_step(
            self._R_NB, self._omega_BN_B, self._torque_B + external_B,
            inertia_kg_m2=self.config.inertia_kg_m2, step_s=step_s, forcing='symmetric')

    def _external_B(self) -> Array:
        """Return disturbance, gravity gradient and dipole's torque (3,) at this attitude [N m].

        At the place in the middle of the plant's step, so that both its ends have the same.
        """
        torque_B = self._disturbance
        if self._inertial_disturbance:
            torque_B = self._R_NB.T @ self._disturbance
        if self.config.orbit is not None:
            position_N = self.config.orbit.position_N_m((self._steps - 0.5) * self.step_s)
            torque_B = torque_B + gravity_gradient_B(self._R_NB, position_N, self._mass_inertia)
            if self.dipole_B_a_m2.any():
                field_B = self._R_NB.T @ dipole_field_N(position_N)
                torque_B = torque_B + np.cross(self.dipole_B_a_m2, field_B)
        return torque_B

    @property
    def field_B_t(self) -> Array:
        """The magnetic field (3,) in body axes [T], zero without an orbit."""
        if self.config.orbit is None:
            return np.zeros(3)
        return np.asarray(self._R_NB.T @ dipole_field_N(
            self.config.orbit.position_N_m(self.time_s)))

    @property
    def _mass_inertia(self) -> Array:
        """The inertia (3, 3) of all mass, which gravity acts on [kg m^2]."""
        return self.config.inertia_kg_m2
