# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run: the bag's topics as arrays, with the scenario that it was recorded from."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, SIMULATOR_NAME
from manifold_mpc_ros.errors import BagError, ConfigurationError
from manifold_mpc_ros.lab.recording.bags import assemble
from manifold_mpc_ros.lab.recording.bags.contents import (
    CUSTOM_DESCRIPTION,
    CUSTOM_OUTCOME,
    CUSTOM_SCENARIO,
    DESCRIPTION_TOPIC,
    END_TOPIC,
    BagContents,
    RunDescription,
)
from manifold_mpc_ros.lab.recording.bags.decode import WRENCH, read_text
from manifold_mpc_ros.lab.recording.bags.reader import read_bag
from manifold_mpc_ros.lab.recording.bags.series import (
    CommandSeries,
    PredictionSeries,
    ReferenceSeries,
    SetpointSeries,
    StateSeries,
    TickSeries,
)
from manifold_mpc_ros.lab.recording.bags.targets import Commanded, read_moving_setpoint
from manifold_mpc_ros.lab.recording.bags.translate import StackDescriptions, translated
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.target import error_angle

#: How the recorder ended.
COMPLETE = 'complete'


@dataclass(frozen=True)
class TopicNames:
    """The topic of each part of a run; the type is what the bag says.

    ``state`` is nav_msgs/Odometry or sensor_msgs/Imu; a stack that publishes attitude and rate
    apart has ``state`` empty, ``pose`` (PoseStamped) and ``twist`` (TwistStamped, body axes).
    ``received_state`` is what reached the controller, where that is another topic.
    """

    state: str = '/odometry'
    pose: str = ''
    twist: str = ''
    received_state: str = ''
    torque: str = '/torque_command'
    attitude_setpoint: str = '/attitude_setpoint'
    direction_setpoint: str = '/direction_setpoint'
    reference: str = '/reference'
    odometry_setpoint: str = '/odometry_setpoint'
    diagnostics: str = '/diagnostics'
    prediction: str = '/attitude_controller/prediction'
    stack: StackDescriptions | None = None


@dataclass(frozen=True, eq=False)
class BagRun:
    """One run, read from a bag.

    ``states`` are the plant's, ``received_states`` what reached the controller (the same
    object unless a link stood between). ``scenario`` is that inside the bag, or the one it is
    judged by; None for a bag from elsewhere without. ``lockstep``: the bag proves that time waited
    for each torque. ``outcome`` is 'complete' when the recording came to its end; otherwise it
    says why not, '' when unknown. ``warnings`` has a sentence for everything that is missing or
    damaged, ``notes`` for what is no damage. ``contents`` keeps every message as bytes.
    """

    path: Path
    scenario: Scenario | None
    description: RunDescription
    lockstep: bool
    outcome: str
    states: StateSeries
    received_states: StateSeries
    commands: CommandSeries
    setpoints: SetpointSeries
    references: ReferenceSeries
    ticks: TickSeries
    predictions: PredictionSeries
    topics: TopicNames
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    contents: BagContents

    @property
    def title(self) -> str:
        """What the run is called."""
        return self.description.scenario_name or self.path.stem

    @property
    def backend(self) -> str:
        """The backend of the solver that commanded, '' when the bag does not say."""
        return self.description.backend or self.ticks.last.get('backend', '')

    @property
    def config(self) -> AttitudeMpcConfig:
        """The control law of its scenario, the shipped one without."""
        return (self.scenario or assemble.shipped_scenario()).controller_config.mpc

    @cached_property
    def commanded(self) -> Commanded:
        """What was commanded; at first the initial setpoint (identity, or the first attitude)."""
        initial = np.eye(3)
        if len(self.states) and self.scenario is not None \
                and self.scenario.controller_config.initial_setpoint == 'hold':
            initial = self.states.R_NB[0]
        return Commanded.of(initial, self.setpoints, self.references)

    @cached_property
    def _target(self) -> tuple[Array, Array]:
        """R_ND (n, 3, 3) and omega_DN_D (n, 3) at each state."""
        return self.commanded.at(self.states.stamp_ns)

    @property
    def R_ND(self) -> Array:
        """The commanded attitude at each state (n, 3, 3)."""
        return self._target[0]

    @cached_property
    def error_rad(self) -> Array:
        """The angle left to turn at each state (n,), of the attitude or of the pointing axis."""
        R_DB = np.swapaxes(self.R_ND, -1, -2) @ self.states.R_NB
        return np.asarray(error_angle(self.config, R_DB))

    @property
    def rate_error_rad_s(self) -> Array:
        """The norm of the body rate beside the target's, at each state (n,)."""
        R_ND, omega_DN_D = self._target
        omega_DN_N = R_ND @ omega_DN_D[..., None]
        omega_DN_B = (np.swapaxes(self.states.R_NB, -1, -2) @ omega_DN_N)[..., 0]
        return np.asarray(np.linalg.norm(self.states.omega_BN_B - omega_DN_B, axis=1))


def read_run(
    path: str | Path, topics: TopicNames | None = None, scenario: Scenario | None = None,
) -> BagRun:
    """Read a bag as a run.

    Arguments
    ---------
    path
        A bag: folder or storage file.
    topics
        The topics to take; None means those that the recorder noted, or else its usual ones. The
        only torques of a bag are taken whatever their topic is.
    scenario
        What to judge the run by, instead of the scenario inside the bag.

    Raises BagError when the bag cannot be read, or has no state.

    """
    contents = read_bag(path)
    warnings, notes = list(contents.warnings), list(contents.notes)
    description = _description(contents, warnings)
    names = topics or _noted(description)
    if names.stack is not None:
        contents = translated(contents, names.stack, warnings)
    names = _with_torque(names, contents, notes)
    inside = _scenario(contents, description, warnings)
    lockstep = description.controller_parameters.get('lockstep') is True if inside is None \
        else inside.lockstep
    source = assemble.Source(contents, warnings, notes)
    states = source.states(names.state, names.pose, names.twist)
    if not len(states):
        raise _no_state(contents, names, warnings)
    received = states
    if names.received_state and names.received_state != names.state:
        received = source.states(names.received_state, '', '')
    first_ns = int(states.stamp_ns[0])
    config = (scenario or inside or assemble.shipped_scenario()).controller_config
    valid_s = float(description.controller_parameters.get(
        'reference.timeout_s', config.reference_timeout_s))
    commands = source.commands(names.torque, first_ns, once=lockstep)
    return BagRun(
        path=Path(path), scenario=scenario or inside, description=description,
        lockstep=lockstep, outcome=_outcome(contents), states=states, received_states=received,
        commands=commands,
        setpoints=source.setpoints(
            names.attitude_setpoint, names.direction_setpoint, first_ns, config.mpc),
        references=source.references(
            names.reference, names.odometry_setpoint if valid_s else '', first_ns,
            partial(read_moving_setpoint, valid_s=valid_s, config=config.mpc)),
        ticks=source.ticks(names.diagnostics, len(commands) if lockstep else None),
        predictions=source.predictions(names.prediction), topics=names,
        warnings=tuple(dict.fromkeys(warnings)), notes=tuple(dict.fromkeys(notes)),
        contents=contents)


def _no_state(contents: BagContents, names: TopicNames, warnings: list[str]) -> BagError:
    """Return why there is no state: the reasons with their numbers, or no such topic."""
    wanted = names.state or f'{names.pose} with {names.twist}'
    topics = [names.state] if names.state else [names.pose, names.twist]
    reasons = [warning for warning in warnings if warning.startswith(tuple(topics))]
    if not reasons:
        reasons = ['the topics are ' + ', '.join(
            f'{topic.name} ({topic.kind or "no type"})' for topic in contents.topics.values())]
    return BagError(f'{contents.path}: no state can be read on {wanted}; ' + '; '.join(reasons))


def _with_torque(names: TopicNames, contents: BagContents, notes: list[str]) -> TopicNames:
    """Return the topics, the usual one of torques replaced where another is the only one."""
    there = [topic.name for topic in contents.topics.values() if topic.kind == WRENCH]
    if names.torque != TopicNames.torque or names.torque in there or not there:
        return names
    if len(there) > 1:
        notes.append('torques are on ' + ', '.join(there) + '; --torque names those to take')
        return names
    return replace(names, torque=there[0])


def _outcome(contents: BagContents) -> str:
    """Return how the recording ended: by its metadata, or else its last message."""
    if CUSTOM_OUTCOME in contents.custom:
        return contents.custom[CUSTOM_OUTCOME]
    for message in contents.of(END_TOPIC)[-1:]:
        with suppress(ValueError, AttributeError):
            return str(json.loads(read_text(message)).get(CUSTOM_OUTCOME, ''))
    return ''


def _description(contents: BagContents, warnings: list[str]) -> RunDescription:
    """Return where the bag comes from: its first message, its metadata, or what the nodes say."""
    texts = [contents.custom.get(CUSTOM_DESCRIPTION, '')]
    for message in contents.of(DESCRIPTION_TOPIC)[:1]:
        try:
            texts.insert(0, read_text(message))
        except ValueError:
            warnings.append(f'{DESCRIPTION_TOPIC}: the description of the run is damaged')
    for text in filter(None, texts):
        try:
            return RunDescription.from_json(text)
        except ValueError:
            warnings.append('the description of the run is damaged')
    controller = _said_by(CONTROLLER_NAME, contents, warnings)
    return RunDescription.from_json(json.dumps({
        'versions': controller.get('versions'), 'backend': controller.get('backend'),
        'controller_parameters': controller.get('parameters'),
        'simulator_parameters': _said_by(SIMULATOR_NAME, contents, warnings).get('parameters')}))


def _said_by(node: str, contents: BagContents, warnings: list[str]) -> dict[str, Any]:
    """Return what a node said last on its latched ``~/description``, empty without it."""
    topics = [topic for topic in contents.topics
              if topic.endswith(f'/{node}/description')]
    for message in [each for topic in topics for each in contents.of(topic)][-1:]:
        try:
            said = json.loads(read_text(message))
            return said if isinstance(said, dict) else {}
        except ValueError:
            warnings.append(f'{message.topic}: the description of the node is damaged')
    return {}


def _noted(description: RunDescription) -> TopicNames:
    """Return the topics that the recorder noted, the usual ones where it noted none."""
    known = {field.name for field in fields(TopicNames)} - {'stack'}
    roles: dict[str, Any] = {role: str(topic) for role, topic in description.topics.items()
                             if role in known}
    return TopicNames(**roles, stack=StackDescriptions.of(description.controller_parameters))


def _scenario(
    contents: BagContents, description: RunDescription, warnings: list[str],
) -> Scenario | None:
    """Return the scenario inside the bag, None without a usable one."""
    text = description.scenario_text or contents.custom.get(CUSTOM_SCENARIO, '')
    if not text:
        return None
    try:
        return Scenario.from_text(text, description.scenario_name or 'scenario')
    except ConfigurationError as error:
        warnings.append(f'the scenario inside the bag cannot be used: {error}')
        return None
