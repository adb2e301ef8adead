# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A scenario: one complete case of the closed loop, read from YAML and checked as a whole."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from manifold_mpc_ros.config.control_law import SimulatorConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.description import (
    DESCRIBED,
    EARLIER_NAMES,
    SHIPPED_STATES,
    text_of,
)
from manifold_mpc_ros.config.guidance import GUIDANCE_PARAMETERS, GuidanceConfig
from manifold_mpc_ros.config.parameter import Value, resolve_parameters
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS, SIMULATOR_PARAMETERS
from manifold_mpc_ros.config.yaml_file import parse_mapping, read_text
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.recording.scenarios.changes import (
    named,
    parameter_changes,
    with_parameter_file,
)
from manifold_mpc_ros.lab.recording.scenarios.keys import (
    GROUPS,
    SCENARIO_KEYS,
    TIME_KEYS,
    check_group,
)
from manifold_mpc_ros.lab.recording.scenarios.parts import (
    AcceptanceLimits,
    Faults,
    Setpoint,
    as_mapping,
    setpoints_from,
)

#: Parameters of both nodes that the scenario's ``time`` decides.
DECIDED_BY_TIME = dict.fromkeys((
    'lockstep', 'autostart', 'timing.publish_clock', 'timing.real_time_factor', 'use_sim_time',
), 'time.mode')
#: The simulator speaks as the controller does.
DECIDED_AT_SIMULATOR = {
    **DECIDED_BY_TIME, 'state_sinks': 'controller.state_source',
    'command_source': 'controller.command_sink',
    'full_scale_torque_n_m': 'controller.full_scale_torque_n_m'}
#: Of guidance: a setpoint names the mode, and its attitudes reach to the end of the run.
DECIDED_AT_GUIDANCE = {
    'mode': 'setpoints[].guidance', 'period_s': 'setpoints[].at_s', 'ahead_s': 'duration_s',
    'inertial_frame_id': 'controller.inertial_frame_id', 'autostart': 'time.mode'}


def is_shipped_state(state_source: str) -> bool:
    """Say whether states come as the simulator publishes them unless it is told otherwise."""
    return EARLIER_NAMES.get(state_source, state_source) in SHIPPED_STATES


@dataclass(frozen=True, eq=False)
class Scenario:
    """One case: spacecraft, controller, commands, faults, and what the run is judged by.

    ``controller``, ``simulator`` and ``guidance`` hold the changes to the shipped parameters by
    their dotted ROS names; `controller_parameters` and `simulator_parameters` are complete.
    ``text`` is the YAML that it was read from, to the letter unless that names a parameter file.

    Raises ConfigurationError from the constructors; names the key, its value and what would be
    valid.
    """

    name: str
    description: str
    duration_s: float
    controller: Mapping[str, Value]
    simulator: Mapping[str, Value]
    guidance: Mapping[str, Value]
    setpoints: tuple[Setpoint, ...]
    time_mode: str
    clock_factor: float
    faults: Faults
    acceptance: AcceptanceLimits
    text: str

    @classmethod
    def from_yaml(cls, path: str | Path) -> Scenario:
        """Read a scenario file; its name is the file's, without ``.yaml``.

        Files of descriptions, beside it, become a part of its text, and so does the parameter
        file of both nodes that ``parameters`` names.
        """
        text = with_parameter_file(read_text(path, 'scenario'), Path(path), DECIDED_BY_TIME)
        given = parse_mapping(text, 'scenario', str(path))
        controller = given.get('controller')
        if isinstance(controller, dict):
            files = {name: text_of(str(Path(path).parent / str(controller[name])))
                     for name in DESCRIBED
                     if str(controller.get(name)).endswith(('.yaml', '.yml'))}
            controller.update(files)
            text = yaml.safe_dump(given, sort_keys=False) if files else text
        return cls.from_text(text, Path(path).stem, str(path))

    @classmethod
    def from_text(cls, text: str, name: str, source: str = 'scenario') -> Scenario:
        """Read a scenario from YAML text; ``source`` is what messages call it."""
        values = check_group(
            SCENARIO_KEYS, GROUPS, parse_mapping(text, 'scenario', source), '')
        time: dict[str, Any] = check_group(
            TIME_KEYS, {}, as_mapping(values.get('time')), 'time.')
        scenario = cls(
            name=name, description=' '.join(str(values['description']).split()),
            duration_s=values['duration_s'],
            controller=parameter_changes(
                'controller', CONTROLLER_PARAMETERS, as_mapping(values.get('controller')),
                DECIDED_BY_TIME),
            simulator=parameter_changes(
                'simulator', SIMULATOR_PARAMETERS, as_mapping(values.get('simulator')),
                DECIDED_AT_SIMULATOR),
            guidance=parameter_changes(
                'guidance', GUIDANCE_PARAMETERS, as_mapping(values.get('guidance')),
                DECIDED_AT_GUIDANCE),
            setpoints=setpoints_from(values.get('setpoints')),
            time_mode=time.get('mode', 'lockstep'), clock_factor=time.get('factor', 1.0),
            faults=Faults.from_mapping(as_mapping(values.get('faults'))),
            acceptance=AcceptanceLimits.from_mapping(as_mapping(values.get('acceptance'))),
            text=text)
        scenario._check_together()
        return scenario

    @property
    def lockstep(self) -> bool:
        """Whether time waits for each torque, so that every run has the same bits."""
        return self.time_mode == 'lockstep'

    @property
    def controller_parameters(self) -> dict[str, Value]:
        """Every parameter of the controller by name, those of ``time`` included."""
        changed = {**self.controller, 'lockstep': self.lockstep, 'autostart': False}
        return resolve_parameters(CONTROLLER_PARAMETERS, changed, complete=False)

    @property
    def simulator_parameters(self) -> dict[str, Value]:
        """Every parameter of the simulator by name, those of ``time`` included."""
        clock, controller = self.time_mode == 'clock', self.controller_parameters
        source = str(controller['state_source'])
        changed = {
            **self.simulator,
            'state_sinks': [*SHIPPED_STATES] if is_shipped_state(source) else [source],
            'command_source': controller['command_sink'],
            'full_scale_torque_n_m': controller['full_scale_torque_n_m'],
            'lockstep': self.lockstep, 'autostart': False,
            'timing.publish_clock': clock,
            'timing.real_time_factor': self.clock_factor if clock else 1.0}
        return resolve_parameters(SIMULATOR_PARAMETERS, changed, complete=False)

    @property
    def use_sim_time(self) -> bool:
        """Whether the controller follows /clock."""
        return self.time_mode == 'clock'

    @property
    def controller_config(self) -> ControllerConfig:
        """The controller's configuration."""
        return ControllerConfig.from_parameters(self.controller_parameters)

    @property
    def simulator_config(self) -> SimulatorConfig:
        """The simulator's configuration."""
        return SimulatorConfig.from_parameters(self.simulator_parameters)

    def guidance_config(self, mode: str) -> GuidanceConfig:
        """Return the configuration of guidance in a mode."""
        return GuidanceConfig.from_parameters(resolve_parameters(GUIDANCE_PARAMETERS, {
            **self.guidance, 'mode': mode,
            'inertial_frame_id': self.controller_parameters['inertial_frame_id'],
        }, complete=False))

    def _check_together(self) -> None:
        """Refuse what does not fit together."""
        controller = named('controller', lambda: self.controller_config)
        simulator = named('simulator', lambda: self.simulator_config)
        step_s = controller.mpc.step_s
        if not math.isclose(simulator.control_period_s, step_s, rel_tol=1e-9):
            raise ConfigurationError(
                'simulator.timing.control_period_s', simulator.control_period_s,
                f'{step_s:g}, the controller.mpc.step_s')
        ticks = self.duration_s / step_s
        if round(ticks) < 1 or not math.isclose(ticks, round(ticks), rel_tol=1e-9):
            raise ConfigurationError(
                'duration_s', self.duration_s, f'a multiple of the control step {step_s:g} s')
        if self.time_mode != 'clock' and self.clock_factor != 1.0:
            raise ConfigurationError(
                'time.factor', self.clock_factor, '1 unless time.mode is clock')
        self._check_setpoints(controller)
        self._check_faults()

    def _check_setpoints(self, controller: ControllerConfig) -> None:
        """Refuse setpoints after the end, and directions that nobody takes."""
        topics = ', '.join(controller.cone_topics)
        for index, setpoint in enumerate(self.setpoints):
            if setpoint.at_s >= self.duration_s:
                raise ConfigurationError(
                    f'setpoints[{index}].at_s', setpoint.at_s,
                    f'less than duration_s, {self.duration_s:g}')
            if setpoint.guidance is not None:
                mode = setpoint.guidance
                named('guidance', lambda: self.guidance_config(mode))  # noqa: B023
                if not controller.reference_timeout_s:
                    raise ConfigurationError(
                        'controller.reference.timeout_s', 0.0,
                        f'above 0 with setpoints[{index}].guidance')
            elif setpoint.cone is not None:
                if setpoint.cone not in controller.cone_topics:
                    raise ConfigurationError(
                        f'setpoints[{index}].cone', setpoint.cone,
                        f'a cone with a direction_topic ({topics or "there is none"})')
            elif setpoint.direction_N is not None and controller.mpc.target != 'pointing':
                raise ConfigurationError(
                    f'setpoints[{index}].direction_N', setpoint.direction_N.tolist(),
                    'attitude_xyzw instead (directions need controller.target: pointing)')

    def _check_faults(self) -> None:
        """Refuse faults that lockstep would undo by waiting."""
        faults = self.faults
        given = {'faults.state_link': faults.state_link.acts,
                 'faults.command_link': faults.command_link.acts,
                 'faults.controller_stops': bool(faults.controller_stops)}
        for name, acts in given.items():
            if acts and self.lockstep:
                raise ConfigurationError(
                    'time.mode', self.time_mode,
                    f'clock or wall with {name} (lockstep waits for every answer)')
