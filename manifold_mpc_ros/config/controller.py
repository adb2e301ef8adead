# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the controller node: the control law, and how the node uses it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.config.cones import check_target, cone_topics
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.description import (
    command_description,
    is_text,
    setpoint_description,
    state_description,
)
from manifold_mpc_ros.config.orbit import KnownTorque
from manifold_mpc_ros.config.parameter import Value, by_field, read_values
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, CONTROLLER_PARAMETERS
from manifold_mpc_ros.config.wheel_parameters import Magnetorquers
from manifold_mpc_ros.errors import ConfigurationError

#: A torque that acts later than this many steps after its command is not planned for.
LONGEST_DELAY_STEPS = 10


@dataclass(frozen=True, eq=False)
class ControllerConfig:
    """Everything that `config/controller.yaml` says; its comments describe each field."""

    mpc: AttitudeMpcConfig
    backend: str
    state_source: str
    setpoint_source: str
    command_sink: str
    full_scale_torque_n_m: list[float]
    actuator: str
    actuation_delay_s: float
    estimate_disturbance: bool
    filter_state: bool
    max_disturbance_n_m: list[float]
    drift_n_m: float
    rate_noise_rad_s: float
    reference_timeout_s: float
    slew_torque_fraction: float
    slew_smallest_angle_rad: float
    inertial_frame_id: str
    body_frame_id: str
    initial_setpoint: str
    state_timeout_ticks: int
    decrease_tolerance: float
    attitude_noise_rad: float
    largest_steady_error_rad: float
    scheduler_priority: int
    lock_memory: bool
    lockstep: bool
    autostart: bool
    cone_topics: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    magnetorquers: Magnetorquers | None = None
    known_torque: KnownTorque | None = None

    def __post_init__(self) -> None:
        """Check what the fields together have to satisfy."""
        checks.limit('disturbance.max_torque_n_m', self.max_disturbance_n_m)
        longest_s = LONGEST_DELAY_STEPS * self.mpc.step_s
        if self.actuation_delay_s > longest_s:
            raise ConfigurationError(
                'actuators.actuation_delay_s', self.actuation_delay_s,
                f'at most {LONGEST_DELAY_STEPS} steps, {longest_s:g} s')
        if self.mpc.horizon_s and self.moving:
            raise ConfigurationError(
                'mpc.horizon_s', self.mpc.horizon_s,
                '0 with targets that move (reference.timeout_s, slew_profile.torque_fraction)')
        limit = self.mpc.max_torque_n_m
        if self.slew_torque_fraction and limit is None:
            raise ConfigurationError(
                'slew_profile.torque_fraction', self.slew_torque_fraction,
                '0 without limits.max_torque_n_m, of which it is a part')
        if any(each.normalised for each in command_description(self.command_sink)) and (
                limit is None or not (limit <= self.full_scale_torque_n_m).all()):
            raise ConfigurationError(
                'full_scale_torque_n_m', self.full_scale_torque_n_m,
                'at least limits.max_torque_n_m, '
                f'{"which has no limit" if limit is None else limit.tolist()}')

    @classmethod
    def from_yaml(cls, path: str | Path) -> ControllerConfig:
        """Read the controller's ROS parameter file, every key of it checked; needs no ROS."""
        return cls.from_parameters(read_values(path, CONTROLLER_NAME, CONTROLLER_PARAMETERS))

    @classmethod
    def from_parameters(cls, values: Mapping[str, Value]) -> ControllerConfig:
        """Build from the node's checked parameters; raises ConfigurationError."""
        chosen = by_field(CONTROLLER_PARAMETERS, values, cls)
        state_description(chosen['state_source'])
        setpoint_description(chosen['setpoint_source'])
        mpc = AttitudeMpcConfig.from_parameters(values)
        if chosen['initial_setpoint'] == 'identity' and mpc.target == 'attitude':
            check_target(mpc.kept_cones, 'initial_setpoint', 'identity')
        return cls(mpc=mpc, cone_topics=cone_topics(values),
                   magnetorquers=Magnetorquers.from_parameters(values),
                   known_torque=KnownTorque.from_parameters(values, mpc.inertia_kg_m2), **chosen)

    @property
    def command_sinks(self) -> tuple[str, ...]:
        """The descriptions of what is published of a command."""
        devices = () if self.actuator == 'torque' else (self.actuator,)
        dipoles = () if self.magnetorquers is None else ('magnetorquers',)
        return tuple(dict.fromkeys((self.command_sink, *devices, *dipoles)))

    @property
    def moving(self) -> bool:
        """Whether what is followed may move."""
        return self.reference_timeout_s > 0.0 or self.slew_torque_fraction > 0.0

    @cached_property
    def state_name(self) -> str:
        """What refused states are counted under: the description, without the way to its file."""
        return 'state' if is_text(self.state_source) else Path(self.state_source).stem

    @property
    def state_timeout_s(self) -> float:
        """Age of the state above which the command is zero [s]."""
        return self.state_timeout_ticks * self.mpc.step_s
