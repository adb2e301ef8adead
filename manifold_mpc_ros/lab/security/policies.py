# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The SROS2 policies in config/sros2, made from what the executables declare to open.

One policy for each node, one for an operator and one for a recorder. Names that are the same in
every namespace are absolute; the others follow the namespace that a keystore is made for.

    python -m manifold_mpc_ros.lab.security.policies FOLDER [--controller-config FILE]

With the parameter file of a controller the policies have the topics of its descriptions
(docs/interfaces.md) instead of the shipped ones, and those that bring it directions of cones.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from manifold_mpc_ros import nodes
from manifold_mpc_ros.config.cones import cone_topics
from manifold_mpc_ros.config.description import PLAIN
from manifold_mpc_ros.config.interfaces import (
    Interfaces,
    command_topics,
    setpoint_topics,
    state_topics,
)
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.tables import (
    CONTROLLER_NAME,
    CONTROLLER_PARAMETERS,
    MARKERS_NAME,
)
from manifold_mpc_ros.config.yaml_file import read_parameter_file
from manifold_mpc_ros.nodes.usage import Program

#: What every node of rclpy publishes, and what every lifecycle node answers (ROS 2 Jazzy).
_LOGS = {'/parameter_events', '/rosout'}
_TRANSITIONS = '~/transition_event'
_SERVICES = {f'~/{name}' for name in (
    'change_state', 'get_available_states', 'get_available_transitions', 'get_state',
    'get_transition_graph', 'describe_parameters', 'get_parameter_types', 'get_parameters',
    'get_type_description', 'list_parameters', 'set_parameters', 'set_parameters_atomically')}
#: The services of one's own: of a node, and of the node that each call of ``ros2`` makes.
_OWN_SERVICES = {'~/*', '/_ros2cli_*/*'}
#: What ``ros2 bag record`` opens beside the topics that it records.
_BAG_SERVICES, _BAG_EVENTS = '/rosbag2_recorder/*', '/events/write_split'

#: (element, what may be done): names. In the order of the file.
Rules = dict[tuple[str, str], set[str]]

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<!-- Copyright 2026 The manifold_mpc_ros authors -->
<!-- SPDX-License-Identifier: Apache-2.0 -->
<!-- {about} -->
<!-- Written by manifold_mpc_ros/lab/security/policies.py; make policies writes it again. -->
<policy version="0.2.0">
  <enclaves>
    <enclave path="/{name}">
      <profiles>
        <profile ns="/" node="{name}">
"""
_END = """        </profile>
      </profiles>
    </enclave>
  </enclaves>
</policy>
"""


def programs(parameters: Mapping[str, Any] | None = None) -> list[Program]:
    """Return what each executable of the package says about itself.

    With ``parameters`` of a controller, topics of states, setpoints, commands and directions are
    theirs, at the other nodes too.
    """
    found = [importlib.import_module(f'{nodes.__name__}.{each.name}.main').PROGRAM
             for each in pkgutil.iter_modules(nodes.__path__) if each.ispkg]
    if parameters is None:
        return found
    values = resolve_parameters(CONTROLLER_PARAMETERS, parameters, complete=False)
    instead = {
        state_topics(): state_topics(str(values['state_source'])),
        setpoint_topics(): setpoint_topics(str(values['setpoint_source'])),
        command_topics(): command_topics(str(values['command_sink']))}
    directions = tuple((topic, 'geometry_msgs/msg/Vector3Stamped', f'direction of cone {name}')
                       for name, (topic, _) in cone_topics(values).items())
    described = [replace(
        program, subscribes=_instead(program.subscribes, instead),
        publishes=_instead(program.publishes, instead)) for program in found]
    return [replace(program, subscribes=program.subscribes + directions)
            if program.node_name in (CONTROLLER_NAME, MARKERS_NAME) else program
            for program in described]


def _instead(interfaces: Interfaces, instead: Mapping[Interfaces, Interfaces]) -> Interfaces:
    """Return interfaces with others in the place of some."""
    kept = tuple(each for each in interfaces if not any(each in some for some in instead))
    return kept + tuple(new for shipped, described in instead.items() for new in described
                        if shipped[0] in interfaces)


def node_rules(program: Program) -> Rules:
    """Return what a node opens, in every configuration, and nothing else."""
    return {
        ('topic', 'publish'): _names(program.publishes) | _LOGS | {_TRANSITIONS},
        ('topic', 'subscribe'): _names(program.subscribes),
        ('service', 'reply'): _names(program.replies) | _SERVICES,
    }


def commands(parameters: Mapping[str, Any] | None = None) -> set[str]:
    """Return what an operator may command."""
    return _names(setpoint_topics((parameters or {}).get('setpoint_source', PLAIN))) | {
        'direction_setpoint', 'odometry_setpoint', 'reference'}


def operator_rules(known: Sequence[Program], commanded: set[str]) -> Rules:
    """Return what somebody needs who commands attitudes and calls the services of every node."""
    transitions = {_seen_from_outside(_TRANSITIONS, program) for program in known}
    return {
        ('topic', 'publish'): commanded | _LOGS,
        ('topic', 'subscribe'): {'/clock', '/diagnostics'} | transitions | _LOGS,
        ('service', 'reply'): _OWN_SERVICES,
        ('service', 'request'): {_seen_from_outside(name, program) for program in known
                                 for name in node_rules(program)['service', 'reply']},
    }


def recorder_rules(known: Sequence[Program], commanded: set[str]) -> Rules:
    """Return what somebody needs who reads every topic and says nothing."""
    topics = {_seen_from_outside(name, program) for program in known
              for use in ('publish', 'subscribe') for name in node_rules(program)['topic', use]}
    return {
        ('topic', 'publish'): _LOGS | {_BAG_EVENTS},
        ('topic', 'subscribe'): topics | commanded | {_BAG_EVENTS},
        ('service', 'reply'): _OWN_SERVICES | {_BAG_SERVICES},
    }


def policies(parameters: Mapping[str, Any] | None = None) -> dict[str, str]:
    """Return the text of each policy, by the name of its file and its enclave."""
    known, commanded = programs(parameters), commands(parameters)
    texts = {program.node_name: policy(
        program.node_name, 'What this node opens, in every configuration, and nothing else.',
        node_rules(program)) for program in known}
    texts['operator'] = policy(
        'operator', 'Commands attitudes, reads diagnostics, calls the services of every node; no '
        'state, no torque.', operator_rules(known, commanded))
    texts['recorder'] = policy(
        'recorder', 'Reads every topic and says nothing: ros2 bag record, a display.',
        recorder_rules(known, commanded))
    return texts


def policy(name: str, about: str, rules: Rules) -> str:
    """Return a policy of SROS2 for one enclave with one node of its name."""
    lines = [_HEAD.format(name=name, about=about)]
    for (element, use), names in rules.items():
        lines.append(f'          <{element}s {use}="ALLOW">\n')
        lines += [f'            <{element}>{each}</{element}>\n' for each in sorted(names)]
        lines.append(f'          </{element}s>\n')
    return ''.join([*lines, _END])


def _names(interfaces: tuple[tuple[str, str, str], ...]) -> set[str]:
    """Return the names alone."""
    return {name for name, _kind, _meaning in interfaces}


def _seen_from_outside(name: str, program: Program) -> str:
    """Return a name of a node as another node in the same namespace writes it."""
    return f'{program.node_name}{name[1:]}' if name.startswith('~') else name


def main() -> None:
    """Write every policy into a folder."""
    parser = argparse.ArgumentParser(description='Write the SROS2 policies of the package.')
    parser.add_argument('folder', type=Path, help='where one XML file for each enclave goes')
    parser.add_argument('--controller-config', type=Path, metavar='FILE',
                        help='parameter file of a controller with other descriptions')
    arguments = parser.parse_args()
    parameters = None if arguments.controller_config is None else read_parameter_file(
        arguments.controller_config, CONTROLLER_NAME)
    for name, text in policies(parameters).items():
        (arguments.folder / f'{name}.xml').write_text(text, encoding='utf-8')


if __name__ == '__main__':
    main()
