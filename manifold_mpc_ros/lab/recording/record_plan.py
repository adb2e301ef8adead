# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a recording needs of its scenario: parameter files, topics, links between the nodes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from manifold_mpc_ros.config.description import (
    CommandMessage,
    Part,
    command_description,
    setpoint_description,
    state_description,
)
from manifold_mpc_ros.config.interfaces import MAGNETIC_FIELD, WHEEL_STATES
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, SIMULATOR_NAME
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.parameter_files import parameter_file_text
from manifold_mpc_ros.lab.recording.scenarios.parts import LinkFault
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario, is_shipped_state

PATH = 'nav_msgs/msg/Path'
#: What a topic is called behind a link.
BEHIND = '_link'
DIRECTION = 'geometry_msgs/msg/Vector3Stamped'
REFERENCE, TRAJECTORY = '/reference', 'trajectory_msgs/msg/MultiDOFJointTrajectory'
OTHERS = {
    '/direction_setpoint': DIRECTION,
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    '/clock': 'rosgraph_msgs/msg/Clock',
    f'/{CONTROLLER_NAME}/transition_event': 'lifecycle_msgs/msg/TransitionEvent',
    f'/{SIMULATOR_NAME}/transition_event': 'lifecycle_msgs/msg/TransitionEvent',
}
PREDICTION = f'/{CONTROLLER_NAME}/prediction'


def absolute(topic: str) -> str:
    """Return the full name of a topic of a node without a namespace."""
    return topic if topic.startswith('/') else f'/{topic}'


@dataclass(frozen=True)
class LinkPlan:
    """One link: the topic before it, the type, and what goes wrong on it."""

    source: str
    kind: str
    fault: LinkFault

    @property
    def target(self) -> str:
        """The topic behind it."""
        return self.source + BEHIND


@dataclass(frozen=True)
class RecordPlan:
    """How a scenario is brought onto a domain."""

    scenario: Scenario

    def __post_init__(self) -> None:
        """Raise ConfigurationError for a fault that cannot be put between these nodes."""
        if self.scenario.faults.state_link.acts and not is_shipped_state(self._state_source):
            raise ConfigurationError(
                'faults.state_link', str(self.scenario.faults.state_link),
                f'left out with state_source {self._state_source}')

    @property
    def _state_source(self) -> str:
        return str(self.scenario.controller_parameters['state_source'])

    @property
    def setpoint(self) -> Part:
        """How commanded attitudes go to the controller."""
        return setpoint_description(str(self.scenario.controller_parameters['setpoint_source']))

    @property
    def state_topic(self) -> str:
        """The topic that the simulator publishes the controller's attitude on."""
        return self.state_topics[0]

    @property
    def state_topics(self) -> tuple[str, str]:
        """Those of attitude and rate."""
        state = state_description(self._state_source)
        return absolute(state.attitude.topic), absolute(state.rate.topic)

    @property
    def duration_s(self) -> float:
        """How long to record: where states have no stamps, a joined one more than the run has."""
        if state_description(self._state_source).attitude.stamp:
            return self.scenario.duration_s
        return self.scenario.duration_s + 3.0 * self.scenario.simulator_config.state_period_s

    @property
    def command_topic(self) -> str:
        """The topic of the torque."""
        return next(iter(self._commands))

    @property
    def _commands(self) -> dict[str, CommandMessage]:
        """The messages that the simulator hears, by topic."""
        given = str(self.scenario.controller_parameters['command_sink'])
        return {absolute(each.topic): each for each in command_description(given)
                if each.fields and each.quantity == 'body_torque'}

    @property
    def described(self) -> dict[str, Part | CommandMessage]:
        """What states and commands say, by topic; behind a link the same as before it."""
        parts: dict[str, Part | CommandMessage] = {**self._commands}
        for given in self.scenario.simulator_parameters['state_sinks']:  # type: ignore[union-attr]
            state = state_description(str(given))
            for part in (state.rate, state.attitude):
                parts[absolute(part.topic)] = part
        return {**parts, **{link.target: parts[link.source] for link in self.links.values()}}

    @property
    def links(self) -> dict[str, LinkPlan]:
        """The links, by node whose input they are.

        The state passes a link also where lockstep has to hold it back until a later setpoint
        has reached the controller, so that every run has the same setpoint at the same tick.
        """
        faults, links = self.scenario.faults, {}
        later = any(setpoint.at_s > 0.0 for setpoint in self.scenario.setpoints)
        if faults.state_link.acts or (later and self.scenario.lockstep):
            links[CONTROLLER_NAME] = LinkPlan(
                self.state_topic,
                state_description(self._state_source).attitude.message_type, faults.state_link)
        if faults.command_link.acts:
            links[SIMULATOR_NAME] = LinkPlan(
                self.command_topic, self._commands[self.command_topic].message_type,
                faults.command_link)
        return links

    @property
    def stamped(self) -> dict[str, str]:
        """Topics by name with their type whose stamps are simulated time."""
        return {PREDICTION: PATH, **{
            topic: each.message_type for topic, each in self.described.items()}}

    @property
    def others(self) -> dict[str, str]:
        """The other topics that are there from the start."""
        moving = {REFERENCE: TRAJECTORY} if self.modes else {}
        return {**OTHERS, **moving, absolute(self.setpoint.topic): self.setpoint.message_type,
                **dict.fromkeys(self.cone_topics.values(), DIRECTION),
                **self.device_commands, **self.device_reports}

    @property
    def device_commands(self) -> dict[str, str]:
        """What devices are commanded, by topic: one message for each torque."""
        return {absolute(each.topic): each.message_type
                for sink in self.scenario.controller_config.command_sinks[1:]
                for each in command_description(sink)}

    @property
    def device_reports(self) -> dict[str, str]:
        """What devices and their sensors report, by topic: one message for each state."""
        used = ((WHEEL_STATES, self.scenario.simulator_config.wheel_motors is not None),
                (MAGNETIC_FIELD, self.scenario.simulator_config.orbit is not None))
        return {absolute(topic): kind for (topic, kind, _), use in used if use}

    @property
    def published(self) -> dict[str, tuple[str, ...]]:
        """The topics of which no message may be missed, by the node that publishes them."""
        return {SIMULATOR_NAME: (*self.state_topics, *self.device_reports),
                CONTROLLER_NAME: (self.command_topic, PREDICTION, *self.device_commands)}

    @property
    def modes(self) -> set[str]:
        """The modes of guidance that are commanded."""
        return {each.guidance for each in self.scenario.setpoints if each.guidance is not None}

    @property
    def cone_topics(self) -> dict[str, str]:
        """The topics of directions of cones, by cone."""
        given = self.scenario.controller_config.cone_topics
        return {name: absolute(topic) for name, (topic, _) in given.items()}

    @property
    def roles(self) -> dict[str, str]:
        """What `TopicNames` cannot know; the topics of a described stack follow from it."""
        if not is_shipped_state(self._state_source):
            return {}
        link = self.links.get(CONTROLLER_NAME)
        return {'state': self.state_topic, 'received_state': link.target if link else ''}

    def arguments(self, node: str, folder: Path) -> list[str]:
        """Write the parameter file of a node; return the ROS arguments to start it with."""
        controller = node == CONTROLLER_NAME
        values: dict[str, Value] = dict(
            self.scenario.controller_parameters if controller
            else self.scenario.simulator_parameters)
        if controller:
            values['use_sim_time'] = self.scenario.use_sim_time
        path = folder / f'{node}.yaml'
        path.write_text(parameter_file_text(node, values), encoding='utf-8')
        arguments = ['--params-file', str(path)]
        link = self.links.get(node)
        if link is not None:
            arguments += ['-r', f'{link.source}:={link.target}']
        return arguments
