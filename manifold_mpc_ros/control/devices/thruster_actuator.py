# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The actuator ``thrusters``: a body torque to on-times of on/off thrusters in a control step [s].

With A (3, n) the torques of the thrusters, on-times t of a step h are those of the linear program

    min flow . t - M s    with    A t = s (h tau + rest),    0 <= t <= h,    0 <= s <= 1,

the whole impulse where it can be given (M is large), else the most of it in its direction, with
the least propellant. A pulse shorter than half the shortest one is left out, any other is at least
that long; what impulse is left or was too much is the rest that the next step adds.

What a step gave the body, ``J (omega+ - omega) + h omega_mid x J omega_mid``, tells which thruster
is off (`ThrusterWatch`); it is not used any more. Of two that give the same torque the wrong one
may be taken first: when the other is found too, the first is tried once more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import linprog

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.thrusters import ThrusterArray
from manifold_mpc_ros.control.actuator import Actuation
from manifold_mpc_ros.control.devices.device_watch import ThrusterWatch
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

# A torque of which this part can be given can be given.
_WHOLE = 1.0 - 1e-9


class ThrusterActuator:
    """Thrusters, with pulses and propellant [kg] of what was commanded counted.

    Arguments
    ---------
    thrusters
        The array.
    step_s
        Time for which a command holds [s].
    inertia_kg_m2
        J (3, 3) of the body, by which thrusters that are off are found; None: none is looked for.

    """

    def __init__(self, thrusters: ThrusterArray, step_s: float,
                 inertia_kg_m2: Array | None = None) -> None:
        """Begin with nothing carried on."""
        self._thrusters, self._h = thrusters, step_s
        self._J, self.watches = inertia_kg_m2, inertia_kg_m2 is not None
        self._watch = ThrusterWatch(thrusters.matrix, thrusters.min_on_time_s)
        self._off, self._twice = np.zeros((2, len(thrusters)), dtype=bool)
        self._omega: Array | None = None
        self._before: tuple[Array, Array] | None = None
        self.refusal = self.found = ''
        self.planned: Array | None = None
        self._rest = np.zeros(3)
        self.pulses, self.propellant_kg = 0, 0.0
        self.usage: Mapping[str, float] = {}

    @classmethod
    def from_config(cls, config: AttitudeMpcConfig) -> ThrusterActuator:
        """Return the actuator of a configuration; raises ConfigurationError without thrusters."""
        if config.thrusters is None:
            raise ConfigurationError('thrusters', None, 'a ThrusterArray, for thrusters')
        return cls(config.thrusters, config.step_s, config.inertia_kg_m2)

    def observe(self, omega_BN_B: Array, devices: Array | None) -> Array | None:
        """Take the body rate (3,) [rad/s], and compare it with that before the last command."""
        if self._before is not None and self.watches and self._J is not None:
            omega, on = self._before
            middle = (omega + omega_BN_B) / 2.0
            gained = self._J @ (omega_BN_B - omega) + self._h * np.cross(middle, self._J @ middle)
            off = self._watch.see(on, self._thrusters.matrix @ on - gained)
            if off is not None:
                self._lose(off)
        self._before, self._omega = None, omega_BN_B
        return devices

    def _lose(self, off: int) -> None:
        """Use a thruster no more, and one that may have been taken for it once more."""
        column, others = self._thrusters.matrix[:, off], self._thrusters.matrix
        along = np.isclose(
            column @ others, np.linalg.norm(column) * np.linalg.norm(others, axis=0))
        again = self._off & along & ~self._twice
        self._twice |= again
        self._off = self._off & ~again
        self._off[off] = True
        names = [name for name, off in zip(self._thrusters.names, self._off) if off]
        self.found = f'{", ".join(names)} gives no torque: not used until ~/reset'
        try:
            replace(self._thrusters, failed=[*self._thrusters.failed, *names])
            self.refusal = ''
        except ConfigurationError:
            self.refusal = f'without {", ".join(names)} thrusters give no torque about some axis'

    def limited(self, torque_B_n_m: Array, part: float = 1.0) -> Array:
        """Scale a finite torque (3,) [N m] into this part of what the thrusters can give."""
        share = self._parts(torque_B_n_m, part)[1]
        return torque_B_n_m if share >= _WHOLE else share * torque_B_n_m

    def _parts(self, torque_B_n_m: Array, longest: float = 1.0) -> tuple[Array, float]:
        """Return parts of the step (n,), each at most ``longest``, and the part s of a torque."""
        size = float(np.abs(torque_B_n_m).max())
        n = len(self._thrusters)
        if size == 0.0:
            return np.zeros(n), 1.0
        flow = self._thrusters.flow_kg_s / self._thrusters.flow_kg_s.sum()
        scale = float(np.abs(self._thrusters.matrix).max())
        asked = np.clip(torque_B_n_m / scale, -1e3 * n, 1e3 * n)
        found = linprog(np.append(flow, -1e3),
                        A_eq=np.hstack([self._thrusters.matrix / scale, -asked[:, None]]),
                        b_eq=np.zeros(3), bounds=[
                            *((0.0, longest * each)
                              for each in self._thrusters.longest * ~self._off),
                            (0.0, 1.0)])
        return np.asarray(found.x[:n]), float(found.x[n])

    def allocate(self, torque_B_n_m: Array) -> Actuation:
        """Map a torque (3,) [N m] within the limits to on-times (n,) [s]."""
        h, shortest = self._h, self._thrusters.min_on_time_s
        impulse = h * torque_B_n_m + self._rest
        on = h * self._parts(impulse / h)[0]
        on = np.where(on < shortest / 2.0, 0.0, np.clip(on, np.minimum(shortest, h), h))
        given = self._thrusters.matrix @ on
        # No more is carried on than pulses can be short of, whatever could not be given.
        most = np.abs(self._thrusters.matrix) @ shortest
        self._rest = np.clip(impulse - given, -most, most)
        self.pulses += int(np.count_nonzero(on))
        self.propellant_kg += float(self._thrusters.flow_kg_s @ on)
        self.usage = {'pulses': self.pulses, 'propellant_kg': self.propellant_kg, **{
            f'{name}_on_s': float(time_s) for name, time_s in zip(self._thrusters.names, on)}}
        if self._omega is not None:
            self._before, self._omega = (self._omega, on), None
        return Actuation(torque_B_n_m, on, given / h)

    def rest(self) -> Actuation:
        """Command no pulse, and carry nothing on."""
        self._rest, self._omega = np.zeros(3), None
        return Actuation(np.zeros(3), np.zeros(len(self._thrusters)), np.zeros(3))
