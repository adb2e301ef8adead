# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The SROS2 policies: made from the tables, and exactly what running nodes open, seen on DDS.

The refusal to go without security.

Enforcement itself is in `test_security_enforcement.py`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.security.policies import commands, policies
from manifold_mpc_ros.nodes.security import demand_enforcement

if TYPE_CHECKING:
    from harness import Rig

SROS2 = Path(__file__).parents[2] / 'config' / 'sros2'
NODES = ('attitude_controller', 'attitude_guidance', 'attitude_markers', 'lgvi_simulator')
BOND = {'bond_period_s': 0.1}
DIPOLES = {'magnetorquers.max_dipole_a_m2': [1.0]}
#: Parameters of the controller, the simulator and the markers: together they open everything.
CONFIGURATIONS: list[tuple[dict[str, object], ...]] = [
    ({'target': 'pointing', 'use_sim_time': True, 'reference.timeout_s': 1.0,
      'actuators.kind': 'thrusters'},
     {'timing.publish_clock': True, 'use_sim_time': True, 'actuators.kind': 'thrusters',
      'orbit.altitude_m': 5e5},
     {'use_sim_time': True}),
    ({'state_source': 'imu', 'actuators.kind': 'wheels', **DIPOLES, **BOND},
     {'actuators.kind': 'wheels', **DIPOLES, **BOND},
     {'state_source': 'imu', **BOND}),
]
#: What every node of rclpy publishes.
LOGS = {'/parameter_events', '/rosout'}
#: The same in every namespace, for every node.
ABSOLUTE = {*LOGS, '/clock', '/diagnostics'}
Rules = dict[str, set[str]]


def written(name: str) -> Rules:
    """Return the names that a policy allows, as they are written, by what may be done."""
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
        assert names == sorted(set(names))
        allowed[what] = set(names)
    return allowed


def rules(name: str) -> Rules:
    """Return the absolute names that a policy allows, by what may be done."""
    return {what: {f'/{name}/{each[2:]}' if each.startswith('~/') else f'/{each.lstrip("/")}'
                   for each in names} for what, names in written(name).items()}


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
    """Whether every node is in the graph with all that it opens last."""
    names = {name for name, _ in rig.node.get_node_names_and_namespaces()}
    last = {'attitude_controller': '/attitude_setpoint', 'lgvi_simulator': '/torque_command',
            'attitude_markers': '/torque_command'}
    return set(NODES) <= names and all(
        f'/{node}/set_parameters' in opened(rig, node).get('reply', ())
        and last.get(node, '') in {'', *opened(rig, node).get('subscribe', ())}
        for node in NODES)


def opened_at_last(rig: Rig) -> dict[str, Rules]:
    """Return what the nodes have opened, once nothing has been added for a second."""
    before: dict[str, Rules] = {}
    while before != (now := {node: opened(rig, node) for node in NODES}):
        before = now
        for _ in range(5):
            rig.settle()
    return now


def test_the_nodes_open_exactly_what_their_policies_allow(
    tmp_path: Path, bond_package: Path,
) -> None:
    from harness import open_rig

    seen: dict[str, Rules] = {node: {} for node in NODES}
    for controller, simulator, markers in CONFIGURATIONS:
        with open_rig(tmp_path) as rig:
            own = {'PYTHONPATH': str(bond_package)}
            rig.start('controller', parameters=controller, **own)
            rig.start('simulator', parameters=simulator, **own)
            changes = [text for name, value in markers.items()
                       for text in ('-p', f'{name}:={str(value).lower()}')]
            rig.run(['manifold_mpc_ros.nodes.markers.main', '--ros-args', *changes], **own)
            common = {name: value for name, value in markers.items() if name != 'state_source'}
            rig.start('guidance', parameters=common, **own)
            rig.watch(MarkerArray, '/attitude_markers/markers')  # it listens while one looks
            rig.until(lambda r=rig: everything_is_there(r), 'every node in the graph')
            for node, found in opened_at_last(rig).items():
                for what, names in found.items():
                    seen[node].setdefault(what, set()).update(names)
    for node in NODES:
        assert seen[node] == rules(node)


def test_the_policies_are_what_the_tables_say() -> None:
    """After a change of a table, ``make policies`` writes them again."""
    assert {path.stem: path.read_text(encoding='utf-8') for path in SROS2.glob('*.xml')} == (
        policies())


#: The nodes that read the directions of cones.
READERS = ('attitude_controller', 'attitude_markers', 'recorder')


def topics_of(text: str) -> set[str | None]:
    return {item.text for item in ET.fromstring(text.encode()).iter('topic')}


def test_directions_of_cones_come_to_those_that_read_them_alone() -> None:
    shipped = policies()
    with_cone = policies({
        'cones.names': ['sun'], 'cones.sun.axis_B': [1.0, 0.0, 0.0],
        'cones.sun.half_angle_deg': 20.0,
        'cones.sun.direction_N': [0.0, 1.0, 0.0], 'cones.sun.direction_topic': 'sun_vector'})
    for node, text in with_cone.items():
        expected = {'sun_vector'} if node in READERS else set()
        assert topics_of(text) - topics_of(shipped[node]) == expected


def test_a_controller_of_another_stack_opens_its_topics_and_no_others() -> None:
    shipped = policies()
    theirs = policies({'state_source': 'px4', 'command_sink': 'px4',
                       'setpoint_source': 'space_station_os'})

    ours = {'odometry', 'imu', 'attitude_setpoint', 'torque_command'}
    states = {'/fmu/out/vehicle_attitude', '/fmu/out/vehicle_angular_velocity'}
    commands = {'/fmu/in/vehicle_torque_setpoint', '/fmu/in/offboard_control_mode'}
    for node in ('attitude_controller', 'attitude_markers', 'lgvi_simulator'):
        setpoint = set() if node == 'lgvi_simulator' else {'/gnc/pose_ref'}
        before, after = topics_of(shipped[node]), topics_of(theirs[node])
        assert before - after == (ours if setpoint else ours - {'attitude_setpoint'})
        assert after - before == states | commands | setpoint
    assert '/gnc/pose_ref' in topics_of(theirs['operator'])
    assert states <= topics_of(theirs['recorder'])
    assert 'attitude_setpoint' not in topics_of(theirs['operator'])


def test_operator_and_recorder_have_the_least_that_they_need() -> None:
    nodes = [rules(node) for node in NODES]
    operator, recorder = rules('operator'), rules('recorder')
    published = set().union(*(node['publish'] for node in nodes))
    setpoints = {f'/{name}' for name in commands()}
    assert setpoints <= rules('attitude_controller')['subscribe']
    assert operator['request'] == set().union(*(node['reply'] for node in nodes))
    assert 'request' not in recorder
    assert operator['publish'] == LOGS | setpoints
    assert recorder['publish'] == LOGS | {'/events/write_split'}
    assert operator['subscribe'] <= published
    assert recorder['subscribe'] == published | setpoints | {'/events/write_split'}
    # Nobody but the node itself can command torque or claim a state.
    for name in ('attitude_markers', 'lgvi_simulator', 'operator', 'recorder'):
        assert '/torque_command' not in rules(name)['publish']
    for name in ('attitude_controller', 'attitude_markers', 'operator', 'recorder'):
        assert not {'/odometry', '/imu', '/clock'} & rules(name)['publish']


def test_wildcards_are_only_for_services_of_ones_own() -> None:
    own = {'~/*', '/_ros2cli_*/*'}
    wild = {name: {each for names in written(name).values() for each in names if '*' in each}
            for name in policies()}
    assert wild == {**{node: set() for node in NODES}, 'operator': own,
                    'recorder': own | {'/rosbag2_recorder/*'}}
    assert all(own <= written(name)['reply'] for name in ('operator', 'recorder'))


def test_what_has_no_namespace_is_written_absolute() -> None:
    for name in policies():
        names = set().union(*written(name).values())
        assert not {each.lstrip('/') for each in ABSOLUTE} & names
        assert names > LOGS


def test_a_default_node_opens_only_what_the_policies_of_people_allow(rig: Rig) -> None:
    """A default node opens, beside logs, services below its name, which ``~/*`` allows."""
    operator = Node('operator', context=rig.node.context)
    try:
        rig.until(lambda: '/operator/get_parameters' in opened(rig, 'operator').get('reply', ()),
                  'the services of a node')
        found = opened(rig, 'operator')
    finally:
        operator.destroy_node()
    assert found.pop('publish') == LOGS
    assert all(name.startswith('/operator/') for name in found.pop('reply'))
    assert found == {}


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
        with pytest.raises(ConfigurationError, match=name):
            demand_enforcement(environment, '/attitude_controller')


@pytest.mark.parametrize('folder', [None, 'absent', ''])
def test_a_keystore_that_is_not_there_is_one_message_that_names_its_variable(
    rig: Rig, tmp_path: Path, folder: str | None,
) -> None:
    """Not named, not there, and a folder that is none; whether ``secure`` or not."""
    keystore = {} if folder is None else {'ROS_SECURITY_KEYSTORE': str(tmp_path / folder)}
    process = rig.run(
        ['manifold_mpc_ros.nodes.controller.main', '--ros-args', '--enclave', '/a'],
        ROS_SECURITY_ENABLE='true', ROS_SECURITY_STRATEGY='Enforce', **keystore)
    assert process.wait() == 1
    line, = process.log.splitlines()
    assert line.startswith('controller: ROS_SECURITY_KEYSTORE: ')
    assert keystore.get('ROS_SECURITY_KEYSTORE', '') in line


@pytest.mark.parametrize('program', ['controller', 'simulator'])
def test_a_node_that_has_to_be_secure_refuses_to_go_without(rig: Rig, program: str) -> None:
    process = rig.start(program, parameters={'secure': True})
    assert process.wait() == 1
    lines = [line for line in process.log.splitlines() if '[INFO]' not in line]
    assert len(lines) == 1, process.log
    assert 'secure: ' in lines[0]
    assert 'ROS_SECURITY_ENABLE=true' in lines[0]
