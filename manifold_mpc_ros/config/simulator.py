# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the simulated spacecraft and of the node that publishes it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.config.description import (
    PLAIN,
    SHIPPED_STATES,
    CommandMessage,
    Part,
    command_description,
    state_description,
)
from manifold_mpc_ros.config.orbit import CircularOrbit
from manifold_mpc_ros.config.parameter import (
    Value,
    by_field,
    named_as_parameter,
    read_values,
)
from manifold_mpc_ros.config.tables import SIMULATOR_NAME, SIMULATOR_PARAMETERS
from manifold_mpc_ros.config.thrusters import ThrusterArray
from manifold_mpc_ros.config.wheel_parameters import WheelMotors, half_widths
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

#: The least time that a command stays in force, whatever the control period [s].
SHORTEST_COMMAND_LIFE_S = 0.15

_CHECKS: dict[str, checks.Check] = {
    'inertia_kg_m2': checks.inertia, 'max_torque_n_m': checks.limit,
    'initial_attitude_xyzw': checks.unit_quaternion,
    **dict.fromkeys(('initial_rate_rad_s', 'disturbance_torque_n_m'), checks.vector),
    **dict.fromkeys(('step_s', 'state_period_s', 'control_period_s', 'real_time_factor',
                     'lockstep_retry_s', 'lockstep_timeout_s'), checks.positive),
    **dict.fromkeys(('actuation_delay_s', 'attitude_noise_std_rad', 'rate_noise_std_rad_s',
                     'overdue_wait_s'), checks.non_negative),
    'seed': partial(checks.integer, low=0),
    'command_timeout_periods': partial(checks.integer, low=1),
    **dict.fromkeys(('publish_clock', 'lockstep', 'autostart'), checks.boolean)}


@dataclass(frozen=True, eq=False)
class SimulatorConfig:
    """Everything that defines the plant and the timing of its node; arrays are read-only.

    Vectors are in body axes B; ``initial_attitude_xyzw`` is the quaternion of R_NB (body to
    inertial) as x, y, z, w, stored with unit norm. ``max_torque_n_m`` None or inf means no limit.
    ``state_period_s``, ``control_period_s`` and ``actuation_delay_s`` are multiples of ``step_s``;
    a command counts as zero after ``command_timeout_periods`` control periods, 0.15 s at the
    least. With ``wheel_motors`` a command is one motor torque a wheel, and ``max_torque_n_m``
    limits nothing; with ``thrusters`` one on-time a thruster. On an ``orbit`` gravity
    gradient acts. The parameters of ``config/simulator.yaml`` describe each field with its unit
    and range.

    Raises ConfigurationError naming the first field that is invalid, its value and what would be
    valid.
    """

    inertia_kg_m2: Array
    step_s: float = 0.025
    initial_attitude_xyzw: Array = (0.0, 0.0, 1.0, 0.0)  # type: ignore[assignment]
    initial_rate_rad_s: Array = (0.0, 0.0, 0.0)  # type: ignore[assignment]
    max_torque_n_m: Array | None = None
    disturbance_torque_n_m: Array = (0.0, 0.0, 0.0)  # type: ignore[assignment]
    actuation_delay_s: float = 0.0
    attitude_noise_std_rad: float = 0.0
    rate_noise_std_rad_s: float = 0.0
    seed: int = 0
    state_period_s: float = 0.05
    control_period_s: float = 0.5
    command_timeout_periods: int = 3
    real_time_factor: float = 1.0
    publish_clock: bool = False
    overdue_wait_s: float = 1.0
    lockstep: bool = False
    lockstep_retry_s: float = 0.2
    lockstep_timeout_s: float = 10.0
    inertial_frame_id: str = 'inertial'
    body_frame_id: str = 'base_link'
    autostart: bool = True
    wheel_motors: WheelMotors | None = None
    orbit: CircularOrbit | None = None
    thrusters: ThrusterArray | None = None
    thruster_off_from_s: Array = math.inf  # type: ignore[assignment]
    max_dipole_a_m2: Array = 0.0  # type: ignore[assignment]
    state_sinks: Sequence[str] = SHIPPED_STATES
    command_source: str = PLAIN
    full_scale_torque_n_m: Sequence[float] = (np.inf,)

    def __post_init__(self) -> None:
        """Check every field, then what the fields together have to satisfy."""
        n = 1 if self.thrusters is None else len(self.thrusters)
        checks.fields(self, {**_CHECKS, 'thruster_off_from_s': partial(
            checks.each_positive, n=n, infinite=True), 'max_dipole_a_m2': half_widths})
        self._check_timing()
        self._check_messages()

    @classmethod
    def from_yaml(cls, path: str | Path) -> SimulatorConfig:
        """Read the simulator's ROS parameter file, every key of it checked; needs no ROS."""
        return cls.from_parameters(read_values(path, SIMULATOR_NAME, SIMULATOR_PARAMETERS))

    @classmethod
    def from_parameters(cls, values: Mapping[str, Value]) -> SimulatorConfig:
        """Build from the node's checked parameters; errors carry the parameters' names."""
        chosen = by_field(SIMULATOR_PARAMETERS, values, cls)
        try:
            return cls(wheel_motors=WheelMotors.from_parameters(values),
                       orbit=CircularOrbit.from_parameters(values),
                       thrusters=ThrusterArray.from_parameters(values), **chosen)
        except ConfigurationError as error:
            raise named_as_parameter(SIMULATOR_PARAMETERS, error) from None

    @property
    def steps_per_state(self) -> int:
        """Plant steps between two published states when time runs freely."""
        return round(self.state_period_s / self.step_s)

    @property
    def steps_per_control(self) -> int:
        """Plant steps in one control period, which is one exchange in lockstep."""
        return round(self.control_period_s / self.step_s)

    @property
    def delay_steps(self) -> int:
        """Plant steps from a command to its torque."""
        return round(self.actuation_delay_s / self.step_s)

    @property
    def command_life_s(self) -> float:
        """Age at which the last command counts as zero [s of simulated time]."""
        return max(self.command_timeout_periods * self.control_period_s, SHORTEST_COMMAND_LIFE_S)

    def _check_messages(self) -> None:
        """Refuse descriptions that have none, share a topic, or in lockstep have no stamps."""
        states = [state_description(each, 'state_sinks') for each in self.state_sinks]
        topics = [topic for each in states for topic in {each.attitude.topic, each.rate.topic}]
        if len(set(topics)) < len(topics):
            raise ConfigurationError(
                'state_sinks', self.state_sinks, 'descriptions of different topics')
        stamped: list[Part | CommandMessage] = [each.attitude for each in states]
        stamped += [each for each in command_description(self.command_source, 'command_source')
                    if each.fields and each.quantity == 'body_torque']
        for each in stamped:
            if self.lockstep and (not each.stamp or each.stamp_unit_ns):
                raise ConfigurationError(
                    'lockstep', True, f'false with {each.message_type} of {each.topic}, which has '
                    'no stamp by ROS time')

    def _check_timing(self) -> None:
        """Refuse periods that plant steps do not fill, and a time that nobody could follow."""
        for name, least in (('state_period_s', 1), ('control_period_s', 1),
                            ('actuation_delay_s', 0)):
            period = getattr(self, name)
            ratio = period / self.step_s
            if round(ratio) < least or not np.isclose(ratio, round(ratio), rtol=1e-9, atol=0.0):
                raise ConfigurationError(
                    name, period, f'a multiple of the plant step {self.step_s:g} s')
        followed = self.publish_clock or self.lockstep
        if self.real_time_factor != 1.0 and not followed:
            raise ConfigurationError(
                'real_time_factor', self.real_time_factor,
                '1 unless publish_clock or lockstep is true (others could not follow the time)')
