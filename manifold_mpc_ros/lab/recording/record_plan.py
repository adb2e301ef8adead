# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a recording needs of its scenario: parameter files, topics, links between the nodes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from manifold_mpc_ros.config.description import state_description
from manifold_mpc_ros.config.interfaces import command_topics, state_topics
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, SIMULATOR_NAME
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.parameter_files import parameter_file_text
from manifold_mpc_ros.lab.recording.scenarios.parts import LinkFault
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario

PATH = 'nav_msgs/msg/Path'
#: Types of what the simulator publishes of a state, and hears of a command, by topic.
STATES = {f'/{name}': kind for name, kind, _ in state_topics()}
COMMANDS = {f'/{name}': kind for name, kind, _ in command_topics()}
#: What a topic is called behind a link.
BEHIND = '_link'
OTHERS = {
    '/attitude_setpoint': 'geometry_msgs/msg/QuaternionStamped',
    '/direction_setpoint': 'geometry_msgs/msg/Vector3Stamped',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    '/clock': 'rosgraph_msgs/msg/Clock',
    f'/{CONTROLLER_NAME}/transition_event': 'lifecycle_msgs/msg/TransitionEvent',
    f'/{SIMULATOR_NAME}/transition_event': 'lifecycle_msgs/msg/TransitionEvent',
}
PREDICTION = f'/{CONTROLLER_NAME}/prediction'


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
        """Raise ConfigurationError for messages that the simulator does not speak."""
        for parameter, topics, spoken in (
            ('state_source', state_topics, {*STATES.items()}),
            ('command_sink', command_topics, {*COMMANDS.items()}),
        ):
            given = str(self.scenario.controller_parameters[parameter])
            if not {(f'/{name}', kind) for name, kind, _ in topics(given)} <= spoken:
                raise ConfigurationError(
                    parameter, given, 'messages that the simulator speaks: '
                    + ', '.join(sorted(kind for _, kind in spoken)))

    @property
    def state_topic(self) -> str:
        """The topic that the simulator publishes the controller's state on."""
        given = str(self.scenario.controller_parameters['state_source'])
        return f'/{state_description(given).attitude.topic}'

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
                self.state_topic, STATES[self.state_topic], faults.state_link)
        if faults.command_link.acts:
            (topic, kind), = COMMANDS.items()
            links[SIMULATOR_NAME] = LinkPlan(topic, kind, faults.command_link)
        return links

    @property
    def stamped(self) -> dict[str, str]:
        """Topics by name with their type whose stamps are simulated time."""
        behind = {link.target: link.kind for link in self.links.values()}
        return {**STATES, **COMMANDS, PREDICTION: PATH, **behind}

    @property
    def others(self) -> dict[str, str]:
        """The other topics that are there from the start."""
        return OTHERS

    @property
    def roles(self) -> dict[str, str]:
        """What `TopicNames` cannot know."""
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
            arguments += ['-r', f'{link.source.lstrip("/")}:={link.target}']
        return arguments
