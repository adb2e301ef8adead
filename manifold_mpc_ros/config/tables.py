# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the nodes: one table each, from which everything else about them follows."""

from __future__ import annotations

import math
from dataclasses import replace

from manifold_mpc_ros.config.interfaces import ACTUATORS
from manifold_mpc_ros.config.orbit import KNOWN_PARAMETERS, ORBIT_PARAMETERS
from manifold_mpc_ros.config.parameter import ParameterSpec
from manifold_mpc_ros.config.target_parameters import (
    CONE_PARAMETERS,
    HORIZON_PARAMETERS,
    TARGET_PARAMETERS,
)
from manifold_mpc_ros.config.thrusters import THRUSTER_OFF, THRUSTER_PARAMETERS
from manifold_mpc_ros.config.wheel_parameters import (
    MAGNETORQUER_PARAMETERS,
    MAX_DIPOLE,
    MOTOR_PARAMETERS,
    NULL_SPACE,
    WHEEL_PARAMETERS,
)

CONTROLLER_NAME = 'attitude_controller'
SIMULATOR_NAME = 'lgvi_simulator'
MARKERS_NAME = 'attitude_markers'

_INERTIA = ParameterSpec(
    'spacecraft.inertia_kg_m2', 'floats', [1.0, 0.9, 0.6],
    'inertia tensor about the mass centre in body axes: the diagonal, or 9 numbers row by row',
    unit='kg m^2', lengths=(3, 9), required=True, read_only=True)
_MAX_TORQUE = ParameterSpec(
    'limits.max_torque_n_m', 'floats', [0.3, 0.3, 0.3],
    'largest torque about each body axis, either sign', unit='N m', lengths=(1, 3),
    infinite=True, required=True)
_STATE_SOURCE = ParameterSpec(
    'state_source', 'str', 'odometry',
    'messages that bring attitude and body rate: a shipped description by its name, or a YAML '
    'file (docs/interfaces.md)', read_only=True)
_SETPOINT_SOURCE = ParameterSpec(
    'setpoint_source', 'str', 'nav',
    'messages that command attitudes: a description as of state_source', read_only=True)
_COMMAND_SINK = ParameterSpec(
    'command_sink', 'str', 'nav', 'messages of commands: a description as of state_source',
    read_only=True)
_FULL_SCALE = ParameterSpec(
    'full_scale_torque_n_m', 'floats', [math.inf],
    'torque that is 1 in the messages of a normalised command, about each body axis of the stack',
    unit='N m', lengths=(1, 3), infinite=True, read_only=True)
_STATE_SINKS = ParameterSpec(
    'state_sinks', 'strs', ['nav', 'imu'],
    'messages of attitude and body rate, each as somebody reads it: descriptions as of '
    'state_source of the controller', read_only=True)
_COMMAND_SOURCE = ParameterSpec(
    'command_source', 'str', 'nav',
    'messages of commands: the description that the controller has as command_sink',
    read_only=True)
_ACTUATOR = ParameterSpec(
    'actuators.kind', 'str', 'torque', 'what turns the body', choices=tuple(ACTUATORS),
    read_only=True, name_in_config='actuator')
INERTIAL_FRAME = ParameterSpec(
    'inertial_frame_id', 'str', 'inertial', 'frame that attitudes are measured against',
    read_only=True)
_BODY_FRAME = ParameterSpec(
    'body_frame_id', 'str', 'base_link', 'frame of the spacecraft body', read_only=True)
_LOCKSTEP = ParameterSpec(
    'lockstep', 'bool', False,
    'time advances by question and answer, state by state, the same way in every run',
    read_only=True)
AUTOSTART = ParameterSpec(
    'autostart', 'bool', True, 'configure and activate without being asked', read_only=True)
SECURE = ParameterSpec(
    'secure', 'bool', False,
    'refuse to configure unless DDS security is enforced (docs/security.md)', read_only=True)
BOND_PERIOD = ParameterSpec(
    'bond_period_s', 'float', 0.0,
    'period of the heartbeat for a lifecycle manager, by the package bond; 0: no bond', unit='s',
    low=0.0, high=60.0, read_only=True)


def _weight(name: str, default: list[float], description: str, unit: str) -> ParameterSpec:
    """Return the description of one weight matrix of the stage cost."""
    return ParameterSpec(f'mpc.{name}', 'floats', default, description, unit=unit,
                         lengths=(3, 9), required=True)


CONTROLLER_PARAMETERS: tuple[ParameterSpec, ...] = (
    replace(_INERTIA, read_only=False),
    _MAX_TORQUE,
    ParameterSpec(
        'limits.max_rate_rad_s', 'floats', [0.6, 0.6, 0.6],
        'largest body rate about each body axis, either sign', unit='rad/s', lengths=(1, 3),
        infinite=True, required=True),
    ParameterSpec(
        'limits.max_rate_norm_rad_s', 'floats', [math.inf], 'largest length of the body rate',
        unit='rad/s', lengths=(1,), infinite=True),
    ParameterSpec(
        'limits.max_kinetic_energy_j', 'floats', [math.inf],
        'largest kinetic energy of the rotation, omega^T J omega / 2', unit='J', lengths=(1,),
        infinite=True),
    ParameterSpec(
        'limits.keep_rate_between_samples', 'bool', False,
        'keep the rate limits between samples too: plan within them by a proved margin'),
    ParameterSpec(
        'cones.names', 'names', [''],
        'names of the cones that body axes stay out of, or in; each has parameters of its own',
        read_only=True, each=CONE_PARAMETERS),
    *HORIZON_PARAMETERS,
    _weight('attitude_weight', [1.0, 1.0, 1.0], 'Qg of tr(Qg (I - g))', '1'),
    _weight('rate_weight', [0.25, 0.35, 0.65], 'Qf of tr(Qf (I - f)) / h^2', 's^2'),
    _weight('torque_weight', [2.0, 2.0, 2.0], 'R of tr(u^T R u) / 2 with u = tau^x',
            '1/(N m)^2'),
    ParameterSpec(
        'mpc.terminal_scale', 'float', 0.1,
        'lambda of the terminal design, above 0 and below 1', unit='1', low=0.0, high=1.0),
    ParameterSpec(
        'mpc.terminal_constraint', 'bool', True,
        'end every prediction in the terminal set (false: terminal cost only)'),
    ParameterSpec(
        'mpc.forcing', 'str', 'symmetric',
        'discrete forcing: symmetric for a physical plant, paper for the form of the paper',
        choices=('symmetric', 'paper')),
    ParameterSpec(
        'mpc.backend', 'str', 'auto',
        'how the solver runs: as generated and compiled C, which auto means too',
        choices=('auto', 'c'), read_only=True),
    ParameterSpec(
        'target', 'str', 'attitude',
        'what to control: the attitude, or the pointing of one body axis with free roll',
        choices=('attitude', 'pointing'), read_only=True),
    ParameterSpec(
        'pointing.axis_B', 'floats', [0.0, 0.0, 1.0],
        'body axis that points (target: pointing)', unit='1', lengths=(3,), read_only=True,
        name_in_config='pointing_axis_B'),
    ParameterSpec(
        'pointing.weight', 'float', 2.0,
        'w of w (1 - cos(pointing error)) (target: pointing)', unit='1', low=0.0, high=1e12,
        name_in_config='pointing_weight'),
    _STATE_SOURCE,
    _SETPOINT_SOURCE,
    _COMMAND_SINK,
    _FULL_SCALE,
    _ACTUATOR,
    *WHEEL_PARAMETERS,
    NULL_SPACE, *THRUSTER_PARAMETERS,
    ParameterSpec(
        'actuators.actuation_delay_s', 'float', 0.0,
        'time from a command to its torque, which the plan is made for; at most 10 steps',
        unit='s', low=0.0, high=3600.0),
    *MAGNETORQUER_PARAMETERS,
    ParameterSpec(
        'disturbance.estimate', 'bool', False,
        'estimate the torque that acts unasked, and plan with it',
        name_in_config='estimate_disturbance'),
    ParameterSpec(
        'disturbance.filter_state', 'bool', False,
        'plan from attitude and rate as the estimator filters them, not as measured'),
    ParameterSpec(
        'disturbance.max_torque_n_m', 'floats', [math.inf],
        'largest estimate about each body axis; at most half of limits.max_torque_n_m',
        unit='N m', lengths=(1, 3), infinite=True, name_in_config='max_disturbance_n_m'),
    ParameterSpec(
        'disturbance.drift_n_m', 'float', 1e-3,
        'how far the disturbance wanders in a second (standard deviation)', unit='N m', low=0.0,
        high=1e6),
    ParameterSpec(
        'disturbance.rate_noise_rad_s', 'float', 1e-5,
        'standard deviation of a measured rate', unit='rad/s', low=1e-12, high=100.0),
    *KNOWN_PARAMETERS,
    *TARGET_PARAMETERS,
    INERTIAL_FRAME,
    _BODY_FRAME,
    ParameterSpec(
        'initial_setpoint', 'str', 'identity',
        'attitude to reach until an attitude_setpoint comes: the identity, or the first '
        'attitude that is measured', choices=('identity', 'hold')),
    ParameterSpec(
        'state_timeout_ticks', 'int', 5,
        'age of the state, in steps, above which the command is zero', unit='steps', low=1,
        high=1000),
    ParameterSpec(
        'monitor.decrease_tolerance', 'float', 0.1,
        'part of the promised decrease of the value function that may be missing without a '
        'warning', unit='1', low=0.0, high=1.0),
    ParameterSpec(
        'monitor.attitude_noise_rad', 'float', 1e-4,
        'error of a measured attitude, and of the rate in one step, that is no reason to warn',
        unit='rad', low=0.0, high=3.0),
    ParameterSpec(
        'monitor.largest_steady_error_rad', 'float', 0.005,
        'attitude error that may stay for two horizons without a warning', unit='rad', low=0.0,
        high=4.0),
    ParameterSpec(
        'realtime.scheduler_priority', 'int', 0,
        'SCHED_FIFO priority of the process where the system permits it; 0: the normal scheduler',
        low=0, high=98, read_only=True),
    ParameterSpec(
        'realtime.lock_memory', 'bool', False,
        'keep every page of the process in memory where the system permits it', read_only=True),
    _LOCKSTEP,
    SECURE,
    BOND_PERIOD,
    AUTOSTART,
)

SIMULATOR_PARAMETERS: tuple[ParameterSpec, ...] = (
    _INERTIA,
    _MAX_TORQUE,
    _ACTUATOR,
    *WHEEL_PARAMETERS, *THRUSTER_PARAMETERS, MAX_DIPOLE,
    ParameterSpec(
        'plant.step_s', 'float', 0.025, 'integration step of the plant', unit='s', low=0.0,
        high=3600.0, read_only=True),
    ParameterSpec(
        'plant.initial_attitude_xyzw', 'floats', [0.0, 0.0, 1.0, 0.0],
        'attitude at the start and after a reset, body to inertial, as x, y, z, w', unit='1',
        lengths=(4,)),
    ParameterSpec(
        'plant.initial_rate_rad_s', 'floats', [0.0, 0.0, 0.0],
        'body rate at the start and after a reset', unit='rad/s', lengths=(3,)),
    ParameterSpec(
        'plant.disturbance_torque_n_m', 'floats', [0.0, 0.0, 0.0],
        'constant torque in body axes, added after the actuator limits', unit='N m',
        lengths=(3,)),
    ParameterSpec(
        'plant.actuation_delay_s', 'float', 0.0,
        'time from a command to its torque, a multiple of the plant step', unit='s', low=0.0,
        high=60.0),
    *MOTOR_PARAMETERS,
    THRUSTER_OFF, *ORBIT_PARAMETERS,
    ParameterSpec(
        'sensor.attitude_noise_std_rad', 'float', 0.0,
        'standard deviation of the attitude noise about each body axis', unit='rad', low=0.0,
        high=3.0),
    ParameterSpec(
        'sensor.rate_noise_std_rad_s', 'float', 0.0,
        'standard deviation of the rate noise about each body axis', unit='rad/s', low=0.0,
        high=100.0),
    ParameterSpec(
        'sensor.seed', 'int', 0, 'seed of the noise', low=0, high=2**31 - 1),
    ParameterSpec(
        'timing.state_period_s', 'float', 0.05,
        'simulated time between two states, a multiple of the plant step', unit='s', low=0.0,
        high=3600.0, read_only=True),
    ParameterSpec(
        'timing.control_period_s', 'float', 0.5,
        'simulated time that one command is meant for, the step of the controller: lockstep '
        'publishes one state in it', unit='s', low=0.0, high=3600.0, read_only=True),
    ParameterSpec(
        'timing.command_timeout_periods', 'int', 3,
        'control periods (and at least 0.15 s) after which the last command counts as zero',
        unit='periods', low=1, high=1000, read_only=True),
    ParameterSpec(
        'timing.real_time_factor', 'float', 1.0,
        'simulated seconds in one second of wall clock (not used in lockstep)', unit='1',
        low=0.0, high=1000.0, read_only=True),
    ParameterSpec(
        'timing.publish_clock', 'bool', False,
        'publish simulated time on /clock (other nodes: use_sim_time)', read_only=True),
    ParameterSpec(
        'timing.overdue_wait_s', 'float', 1.0,
        'wall clock that simulated time waits, with publish_clock, for a command that is half a '
        'control period late', unit='s', low=0.0, high=3600.0, read_only=True),
    _LOCKSTEP,
    ParameterSpec(
        'lockstep_retry_s', 'float', 0.2,
        'wall clock after which a state without answer is published again', unit='s', low=0.01,
        high=60.0, read_only=True),
    ParameterSpec(
        'lockstep_timeout_s', 'float', 10.0,
        'wall clock after which time advances with zero torque, once a first answer has come',
        unit='s', low=0.1, high=3600.0, read_only=True),
    _STATE_SINKS,
    _COMMAND_SOURCE,
    _FULL_SCALE,
    INERTIAL_FRAME,
    _BODY_FRAME,
    SECURE,
    BOND_PERIOD,
    AUTOSTART,
)

MARKERS_PARAMETERS = (
    _STATE_SOURCE,
    _SETPOINT_SOURCE,
    _COMMAND_SINK,
    _FULL_SCALE,
    ParameterSpec(
        'torque_length_per_n_m', 'float', 3.0,
        'length of the arrow of a torque of 1 N m; the body axes have length 1', unit='1/(N m)',
        low=0.0, high=1e9),
    INERTIAL_FRAME,
    _BODY_FRAME,
    BOND_PERIOD,
    AUTOSTART,
    SECURE,
)
