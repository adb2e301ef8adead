# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The SROS2 policies: exactly what each participant opens, seen on DDS; the refusal to go without.

Enforcement itself is in `test_security_enforcement.py`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.nodes.security import demand_enforcement

if TYPE_CHECKING:
    from harness import Rig

SROS2 = Path(__file__).parents[2] / 'config' / 'sros2'
NODES = ('attitude_controller', 'lgvi_simulator')
#: (parameters of the controller, of the simulator): together they open everything there is.
CONFIGURATIONS = [
    ({'target': 'pointing', 'use_sim_time': True}, {'timing.publish_clock': True}),
    ({'state_source': 'imu'}, {}),
]
Rules = dict[str, set[str]]


def rules(name: str) -> Rules:
    """Return the absolute names that a policy allows, by what may be done."""
    root = ET.parse(SROS2 / f'{name}.xml').getroot()
    assert root.tag == 'policy'
    assert root.get('version') == '0.2.0'
    enclave, = root.iter('enclave')
    assert enclave.get('path') == f'/{name}'
    profile, = root.iter('profile')
    assert (profile.get('ns'), profile.get('node')) == ('/', name)
    allowed: Rules = {}
    for group in profile:
        (what, verdict), = group.attrib.items()
        assert verdict == 'ALLOW'
        names = [item.text or '' for item in group]
        assert names == sorted(names, key=lambda n: (n.startswith('~'), n))
        absolute = {f'/{name}/{n[2:]}' if n.startswith('~/') else f'/{n}' for n in names}
        assert not any('*' in n for n in absolute), 'no wildcards'
        allowed[what] = absolute
    return allowed


def opened(rig: Rig, node: str) -> Rules:
    """Return what a running node has opened, by what is done."""
    graph = rig.node
    look: dict[str, Callable[[str, str], list[tuple[str, list[str]]]]] = {
        'publish': graph.get_publisher_names_and_types_by_node,
        'subscribe': graph.get_subscriber_names_and_types_by_node,
        'reply': graph.get_service_names_and_types_by_node,
        'request': graph.get_client_names_and_types_by_node,
    }
    found = {what: {name for name, _ in names(node, '/')} for what, names in look.items()}
    return {what: names for what, names in found.items() if names}


def everything_is_there(rig: Rig) -> bool:
    """Whether both nodes are in the graph with all that they open last."""
    names = {name for name, _ in rig.node.get_node_names_and_namespaces()}
    return set(NODES) <= names and all(
        f'/{node}/set_parameters' in opened(rig, node).get('reply', ()) for node in NODES) and (
        '/torque_command' in opened(rig, NODES[1]).get('subscribe', ())
        and '/attitude_setpoint' in opened(rig, NODES[0]).get('subscribe', ()))


def opened_at_last(rig: Rig) -> dict[str, Rules]:
    """Return what both nodes have opened, once nothing has been added for a second."""
    before: dict[str, Rules] = {}
    while before != (now := {node: opened(rig, node) for node in NODES}):
        before = now
        for _ in range(5):
            rig.settle()
    return now


def test_the_nodes_open_exactly_what_their_policies_allow(tmp_path: Path) -> None:
    from harness import open_rig

    seen: dict[str, Rules] = {node: {} for node in NODES}
    for controller, simulator in CONFIGURATIONS:
        with open_rig(tmp_path) as rig:
            rig.start('controller', parameters=controller)
            rig.start('simulator', parameters=simulator)
            rig.until(lambda r=rig: everything_is_there(r), 'both nodes in the graph')
            for node, found in opened_at_last(rig).items():
                for what, names in found.items():
                    seen[node].setdefault(what, set()).update(names)
    for node in NODES:
        assert seen[node] == rules(node)


def test_operator_and_recorder_have_the_least_that_they_need() -> None:
    nodes = [rules(node) for node in NODES]
    operator, recorder = rules('operator'), rules('recorder')
    services = set().union(*(node['reply'] for node in nodes))
    published = set().union(*(node['publish'] for node in nodes))
    assert operator['request'] == services
    assert set(recorder) == {'publish', 'subscribe'}
    own = {'/parameter_events', '/rosout'}  # every rclpy node has them
    setpoints = {'/attitude_setpoint', '/direction_setpoint'}
    assert operator['publish'] == own | setpoints
    assert recorder['publish'] == own
    assert operator['subscribe'] <= published
    assert recorder['subscribe'] == published | setpoints
    # Nobody but the node itself can command torque or claim a state.
    for name in ('operator', 'recorder', 'lgvi_simulator'):
        assert '/torque_command' not in rules(name)['publish']
    for name in ('operator', 'recorder', 'attitude_controller'):
        assert not {'/odometry', '/imu', '/clock'} & rules(name)['publish']


def test_enforcement_is_demanded_to_the_letter(tmp_path: Path) -> None:
    (tmp_path / 'enclaves').mkdir()
    good = {'ROS_SECURITY_ENABLE': 'true', 'ROS_SECURITY_STRATEGY': 'Enforce',
            'ROS_SECURITY_KEYSTORE': str(tmp_path)}
    demand_enforcement(good, '/attitude_controller')
    for name, wrong in (('ROS_SECURITY_ENABLE', 'TRUE'), ('ROS_SECURITY_ENABLE', None),
                        ('ROS_SECURITY_STRATEGY', 'Permissive'), ('ROS_SECURITY_STRATEGY', None),
                        ('ROS_SECURITY_KEYSTORE', str(tmp_path / 'absent')),
                        ('ROS_SECURITY_KEYSTORE', None)):
        environment = {k: v for k, v in {**good, name: wrong}.items() if v is not None}
        with pytest.raises(ConfigurationError, match=f'secure.*{name}'):
            demand_enforcement(environment, '/attitude_controller')


@pytest.mark.parametrize('program', ['controller', 'simulator'])
def test_a_node_that_has_to_be_secure_refuses_to_go_without(rig: Rig, program: str) -> None:
    process = rig.start(program, parameters={'secure': True})
    assert process.wait() == 1
    lines = [line for line in process.log.splitlines() if '[INFO]' not in line]
    assert len(lines) == 1, process.log
    assert 'secure: ' in lines[0]
    assert 'ROS_SECURITY_ENABLE=true' in lines[0]
