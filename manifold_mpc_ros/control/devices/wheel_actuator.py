# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The actuator ``wheels``: a body torque to motor torques of reaction wheels [N m].

The torque of the step is made exactly, gyroscopic torque of the stored momentum included, where
motors and momenta leave room. A wheel that is not reported is not used until it is. With fewer
than three independent axes left no torque can be promised: whatever is asked for, every wheel
that works then brakes the body about its own axis, u_i = k w_i . omega, which never adds energy.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.control.actuator import Actuation
from manifold_mpc_ros.control.devices.device_watch import WheelWatch
from manifold_mpc_ros.dynamics.inertia import existence_guard
from manifold_mpc_ros.dynamics.wheel_allocation import WheelAllocation
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array, BoolArray

#: The time constant of braking with too few wheels, in control steps.
BRAKING_STEPS = 4.0


class WheelActuator:
    """Reaction wheels, as they were last reported.

    Arguments
    ---------
    wheels
        The array.
    inertia_kg_m2
        J (3, 3) of the body without the wheels' inertia about their axes.
    step_s
        Time for which a command holds [s].

    ``refusal`` says why no torque can be given, empty when it can.
    """

    def __init__(self, wheels: WheelArray, inertia_kg_m2: Array, step_s: float) -> None:
        """Take the wheels for at rest until they are reported."""
        self.wheels = self._array = wheels
        self._J, self._h = inertia_kg_m2, step_s
        self._braking = existence_guard(inertia_kg_m2) / (BRAKING_STEPS * len(wheels) * step_s)
        self._momentum, self._omega = np.zeros(len(wheels)), np.zeros(3)
        self._unknown, self._lags = np.zeros((2, len(wheels)), dtype=bool)
        self._watch = WheelWatch(wheels.max_torque_n_m, wheels.max_momentum_n_m_s, step_s)
        self._asked: Array | None = None
        self.refusal = self.found = ''
        self.watches = True
        self.planned: Array | None = None
        self.usage: Mapping[str, float] = {}

    @classmethod
    def from_config(cls, config: AttitudeMpcConfig) -> WheelActuator:
        """Return the actuator with the wheels of a configuration.

        Raises ConfigurationError where it has none.
        """
        if config.wheels is None:
            raise ConfigurationError('wheels', None, 'a WheelArray, for wheels as actuators')
        return cls(config.wheels, config.inertia_kg_m2, config.step_s)

    def observe(self, omega_BN_B: Array, devices: Array | None) -> Array | None:
        """Take the body rate (3,) [rad/s] and momenta (n,), NaN where not reported.

        A wheel keeps its last momentum while it is not reported. One that does not do what its
        motor was asked is not used any more.
        """
        self._omega = omega_BN_B
        if devices is None:
            return None
        if self._asked is not None and self.watches:
            lags = self._watch.see(self._asked, self._momentum, devices - self._momentum)
            self._asked = None
            if (lags & ~self._lags).any():
                self._lags = self._lags | lags
                names = [name for name, lag in zip(self._array.names, self._lags) if lag]
                self.found = (f'{", ".join(names)} does not follow its motor: '
                              'not used until ~/reset')
        self._momentum = np.where(np.isfinite(devices), devices, self._momentum)
        unknown = ~np.isfinite(devices) | self._lags
        if (unknown != self._unknown).any():
            self._unknown = unknown
            self._use(unknown)
        return np.where(unknown, np.nan, devices) if unknown.any() else devices

    def _use(self, unknown: BoolArray) -> None:
        """Work with the wheels that are reported, or say why that is too little."""
        try:
            self.wheels, self.refusal = self._array.without(unknown), ''
        except ConfigurationError:
            self.refusal = (f'only {np.count_nonzero(self._working)} of {len(self._array)} wheels '
                            'work: fewer than three independent axes')

    @property
    def _working(self) -> BoolArray:
        """Which wheels work (n,) bool."""
        return np.asarray(self._array.available & ~self._unknown)

    def _allocation(self, torque_B_n_m: Array) -> WheelAllocation:
        """Return the allocation of a torque (3,) in the state of now."""
        return WheelAllocation(
            self.wheels, self._J, self._h, self._omega, self._momentum, torque_B_n_m)

    def limited(self, torque_B_n_m: Array, part: float = 1.0) -> Array:
        """Scale a finite torque (3,) [N m] into what the wheels can give.

        Of less than the whole set, momentum and gyroscopic torque are not counted.
        """
        if self.refusal:
            return torque_B_n_m
        with np.errstate(over='ignore'):
            largest = self.wheels.torques.gauge(torque_B_n_m) / part
        scale = 1.0 / largest if largest > 1.0 else 1.0
        if part == 1.0:
            scale *= self._allocation(scale * torque_B_n_m).part()
        return torque_B_n_m if scale == 1.0 else scale * torque_B_n_m

    def allocate(self, torque_B_n_m: Array) -> Actuation:
        """Map a torque (3,) [N m] within the limits to motor torques (n,) [N m]."""
        if self.refusal:
            return self._braked()
        allocation = self._allocation(torque_B_n_m)
        motor = self._asked = allocation.motor_torques(planned_n_m=self.planned)
        return Actuation(torque_B_n_m, motor, allocation.realised(motor))

    def rest(self) -> Actuation:
        """Return no motor torque: the body feels the gyroscopic torque of the wheels alone."""
        motor = np.zeros(len(self.wheels))
        return Actuation(np.zeros(3), motor, self._allocation(np.zeros(3)).realised(motor))

    def _braked(self) -> Actuation:
        """Return motor torques that take energy from the body."""
        limits = self._array.max_torque_n_m * self._working
        motor = np.clip(self._braking * self._array.axes_B @ self._omega, -limits, limits)
        torque_B = -self._array.axes_B.T @ motor
        return Actuation(torque_B, motor, torque_B)
