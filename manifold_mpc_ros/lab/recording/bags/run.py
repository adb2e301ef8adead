# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run: the bag's topics as arrays, with the scenario that it was recorded from."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from manifold_mpc_ros.config.checks import FloatArray
from manifold_mpc_ros.errors import BagError, ConfigurationError
from manifold_mpc_ros.lab.recording.bags import assemble
from manifold_mpc_ros.lab.recording.bags.contents import (
    CUSTOM_DESCRIPTION,
    CUSTOM_OUTCOME,
    CUSTOM_SCENARIO,
    DESCRIPTION_TOPIC,
    BagContents,
    RunDescription,
)
from manifold_mpc_ros.lab.recording.bags.decode import read_text
from manifold_mpc_ros.lab.recording.bags.reader import read_bag
from manifold_mpc_ros.lab.recording.bags.series import (
    CommandSeries,
    PredictionSeries,
    SetpointSeries,
    StateSeries,
    TickSeries,
)
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario
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
    diagnostics: str = '/diagnostics'
    prediction: str = '/attitude_controller/prediction'


@dataclass(frozen=True, eq=False)
class BagRun:
    """One run, read from a bag.

    ``states`` are the plant's, ``received_states`` what reached the controller (the same
    object unless a link stood between). ``scenario`` is None for a bag from elsewhere.
    ``outcome`` is 'complete' when the recording came to its end; otherwise it says why not,
    '' when unknown. ``warnings`` has a sentence for everything that is missing or damaged.
    ``contents`` keeps every message as bytes.
    """

    path: Path
    scenario: Scenario | None
    description: RunDescription
    outcome: str
    states: StateSeries
    received_states: StateSeries
    commands: CommandSeries
    setpoints: SetpointSeries
    ticks: TickSeries
    predictions: PredictionSeries
    topics: TopicNames
    warnings: tuple[str, ...]
    contents: BagContents

    @property
    def title(self) -> str:
        """What the run is called."""
        return self.description.scenario_name or self.path.stem

    @property
    def R_ND(self) -> FloatArray:
        """The commanded attitude at each state (n, 3, 3).

        The last setpoint with an earlier or equal stamp; before the first one the initial
        setpoint (the identity, or the first attitude).
        """
        initial = np.eye(3)
        if len(self.states) and self.scenario is not None \
                and self.scenario.controller_config.initial_setpoint == 'hold':
            initial = self.states.R_NB[0]
        commanded = np.concatenate([initial[None], self.setpoints.R_ND])
        return commanded[np.searchsorted(
            self.setpoints.stamp_ns, self.states.stamp_ns, side='right')]

    @property
    def error_rad(self) -> FloatArray:
        """The angle left to turn at each state (n,), of the attitude or of the pointing axis."""
        R_DB = np.swapaxes(self.R_ND, -1, -2) @ self.states.R_NB
        config = (self.scenario or assemble.shipped_scenario()).controller_config.mpc
        return np.asarray(error_angle(config, R_DB))


def read_run(path: str | Path, topics: TopicNames | None = None) -> BagRun:
    """Read a bag as a run.

    Arguments
    ---------
    path
        A bag: folder or storage file.
    topics
        The topics to take; None means those that the recorder noted, or else its usual ones.

    Raises
    ------
    BagError
        When the bag cannot be read, or has no state.

    """
    contents = read_bag(path)
    warnings = list(contents.warnings)
    description = _description(contents, warnings)
    names = topics or _noted(description)
    scenario = _scenario(contents, description, warnings)
    source = assemble.Source(contents, warnings)
    states = source.states(names.state, names.pose, names.twist)
    if not len(states):
        wanted = names.state or f'{names.pose} with {names.twist}'
        raise BagError(
            f'{path}: no state can be read on {wanted}; the topics are '
            + ', '.join(f'{topic.name} ({topic.kind})' for topic in contents.topics.values()))
    received = states
    if names.received_state and names.received_state != names.state:
        received = source.states(names.received_state, '', '')
    first_ns = int(states.stamp_ns[0])
    pointing = (scenario or assemble.shipped_scenario()).controller_config.mpc
    lockstep = scenario is not None and scenario.lockstep
    commands = source.commands(names.torque, first_ns, once=lockstep)
    return BagRun(
        path=Path(path), scenario=scenario, description=description,
        outcome=contents.custom.get(CUSTOM_OUTCOME, ''), states=states,
        received_states=received,
        commands=commands,
        setpoints=source.setpoints(
            names.attitude_setpoint, names.direction_setpoint, first_ns, pointing),
        ticks=source.ticks(names.diagnostics, len(commands) if lockstep else None),
        predictions=source.predictions(names.prediction), topics=names,
        warnings=tuple(dict.fromkeys(warnings)), contents=contents)


def _description(contents: BagContents, warnings: list[str]) -> RunDescription:
    """Return where the bag comes from: its first message, or its metadata."""
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
    return RunDescription()


def _noted(description: RunDescription) -> TopicNames:
    """Return the topics that the recorder noted, the usual ones where it noted none."""
    known = {field.name for field in fields(TopicNames)}
    return TopicNames(**{role: str(topic) for role, topic in description.topics.items()
                         if role in known})


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
