# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is let in where security is enforced, and that those who should be can do their work.

Needs a middleware built with its security plugins and the command ``ros2 security``. The wheels
from PyPI have neither: there every test of this file but the last is skipped with that reason.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from harness import PATIENCE_S, Rig, child_environment, log_line
from keystores import enforce, has_sros2
from secured_client import Task, arguments

from manifold_mpc_ros.cli.processes import reserved_domain

if TYPE_CHECKING:
    from harness import Process

NODES = {'controller': 'attitude_controller', 'simulator': 'lgvi_simulator',
         'markers': 'attitude_markers'}
WRENCH, ODOMETRY = 'geometry_msgs/msg/WrenchStamped', 'nav_msgs/msg/Odometry'
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
#: What Fast DDS says when it was built without security.
NO_PLUGINS = "doesn't have the security libraries"
NAMESPACES = ('', '/sat1', '/sat2')
#: Nobody: who does not come in, and commands torque or reads states.
INTRUDER = Task('intruder', {'/torque_command': WRENCH}, {'/odometry': ODOMETRY}, bare=True)


def secured(store: Path) -> dict[str, str]:
    """Return the environment of enforced security."""
    return {'ROS_SECURITY_KEYSTORE': str(store), 'ROS_SECURITY_ENABLE': 'true',
            'ROS_SECURITY_STRATEGY': 'Enforce'}


@dataclass
class Done:
    """What became of a client."""

    status: int
    matched: dict[str, int]
    received: dict[str, int]
    angle_deg: float
    log: str

    @property
    def kept_out(self) -> bool:
        """Whether it ran to its end, and nobody matched it, and nothing came."""
        return self.status == 0 and not any(self.matched.values()) and not any(
            self.received.values())


class Site:
    """A domain, a keystore for it, and what runs there."""

    def __init__(self, domain: int, store: Path) -> None:
        self.domain, self.store = domain, store

    def client(self, task: Task, enclave: str | None, store: Path | None = None) -> Done:
        """Run a task in an enclave of a keystore, or unsigned."""
        command = [sys.executable, *arguments(task)]
        variables: dict[str, str] = {}
        if enclave is not None:
            command += ['--ros-args', '--enclave', enclave]
            variables = secured(store or self.store)
        done = subprocess.run(
            command, env=child_environment(self.domain, **variables), text=True, check=False,
            capture_output=True, timeout=PATIENCE_S + task.seconds)
        said: dict[str, Any] = json.loads(done.stdout.splitlines()[-1]) if (
            done.returncode == 0) else {'matched': {}, 'received': {}, 'angle_deg': 360.0}
        return Done(done.returncode, log=done.stdout + done.stderr, **said)

    def start(self, rig: Rig, program: str, namespace: str = '', **variables: str) -> Process:
        """Start a node in its enclave and wait until it is active."""
        process = rig.run(
            [f'manifold_mpc_ros.nodes.{program}.main', '--ros-args', '--enclave',
             f'{namespace}/{NODES[program]}', '-r', f'__ns:={namespace or "/"}',
             '-p', 'secure:=true'], **{**secured(self.store), **variables})
        rig.until(log_line(process, ']: active'), f'the {program}')
        return process

    def ros2(self, enclave: str, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command of ``ros2`` in an enclave."""
        return subprocess.run(
            ['ros2', *command], text=True, check=False, capture_output=True, timeout=PATIENCE_S,
            env=child_environment(self.domain, ROS_SECURITY_ENCLAVE_OVERRIDE=enclave,
                                  **secured(self.store)))


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """Give a domain with a keystore; skip where nothing can be enforced."""
    if not has_sros2():
        pytest.skip("enforcement is not tested: 'ros2 security' (sros2) is not installed")
    store = tmp_path_factory.mktemp('a folder') / 'key store'
    with reserved_domain() as domain:
        for namespace in NAMESPACES:
            made = enforce(store, namespace or '/', domain=domain)
            assert made.returncode == 0, made.stderr
        site = Site(domain, store)
        tried = site.client(Task('operator', seconds=0.0), '/operator')
        if NO_PLUGINS in tried.log:
            pytest.skip(f'enforcement is not tested: this Fast DDS {NO_PLUGINS}')
        assert tried.status == 0, tried.log
        yield site


@pytest.fixture
def rig(site: Site, tmp_path: Path) -> Iterator[Rig]:
    """Give a rig in the domain of the keystore; its own watcher is a stranger there."""
    rig = Rig(tmp_path, site.domain)
    try:
        yield rig
    finally:
        rig.close()


def test_both_nodes_settle_the_loop(site: Site, rig: Rig) -> None:
    """A default node named recorder, in its enclave, sees the slew of 180 degrees end."""
    for program in NODES:
        site.start(rig, program)
    recorder = site.client(Task('recorder', {}, {
        '/odometry': ODOMETRY, '/torque_command': WRENCH, '/diagnostics': DIAGNOSTICS,
        '/attitude_markers/markers': 'visualization_msgs/msg/MarkerArray',
        '/attitude_controller/prediction': 'nav_msgs/msg/Path',
    }, until_aligned=True, seconds=PATIENCE_S), '/recorder')
    assert recorder.status == 0, recorder.log
    assert all(recorder.received.values()), recorder
    assert recorder.angle_deg < 0.5
    # The watcher of the rig is in the same domain, and unsigned.
    assert not {name for name, _ in rig.node.get_node_names_and_namespaces()} & set(
        NODES.values())


def test_who_is_not_let_in(site: Site, rig: Rig, tmp_path: Path) -> None:
    """Unsigned, signed by another authority, with permissions that were changed."""
    for program in ('controller', 'simulator'):
        site.start(rig, program)
    inside = site.client(Task('inside', {'/torque_command': WRENCH}, bare=True),
                         '/attitude_controller')
    assert inside.matched == {'/torque_command': 1}, inside.log
    assert site.client(INTRUDER, None).kept_out
    other = tmp_path / 'other'
    made = enforce(other, domain=site.domain)
    assert made.returncode == 0, made.stderr
    only_torque = Task('intruder', {'/torque_command': WRENCH}, bare=True)
    stranger = site.client(only_torque, '/attitude_controller', other)
    assert stranger.kept_out, stranger.log
    changed = tmp_path / 'changed'
    shutil.copytree(site.store, changed, symlinks=True)
    signed = changed / 'enclaves' / 'recorder' / 'permissions.p7s'
    text = signed.read_bytes()
    assert text.count(b'<topic>rt/parameter_events</topic>') == 2
    signed.write_bytes(text.replace(b'<topic>rt/parameter_events</topic>',
                                    b'<topic>rt/torque_command</topic>', 1))
    tampered = site.client(only_torque, '/recorder', changed)
    assert tampered.status != 0
    assert 'PKCS7 data verification failed' in tampered.log, tampered.log


@pytest.mark.parametrize(('enclave', 'task', 'topic'), [
    ('/recorder', Task('recorder', {'/torque_command': WRENCH}), 'rt/torque_command'),
    ('/operator', Task('operator', {'/torque_command': WRENCH}), 'rt/torque_command'),
    ('/operator', Task('operator', {'/odometry': ODOMETRY}), 'rt/odometry'),
    ('/operator', Task('operator', {}, {'/odometry': ODOMETRY}), 'rt/odometry'),
    ('/lgvi_simulator', Task('lgvi_simulator', {'/torque_command': WRENCH}),
     'rt/torque_command'),
    ('/recorder', Task('recorder', replies=['/attitude_controller/reset']),
     'rq/attitude_controller/resetRequest'),
    ('/sat1/operator', Task('operator', {'/attitude_setpoint': (
        'geometry_msgs/msg/QuaternionStamped')}, bare=True), 'rt/attitude_setpoint'),
])
def test_what_is_signed_and_not_allowed_is_refused_in_words(
    site: Site, enclave: str, task: Task, topic: str,
) -> None:
    refused = site.client(task, enclave)
    assert refused.status != 0
    assert f'{topic} topic not found in allow rule' in refused.log, refused.log


def test_another_domain_than_the_keystores_is_refused_in_words(site: Site) -> None:
    with reserved_domain() as domain:
        elsewhere = Site(domain, site.store).client(Task('operator', seconds=0.0), '/operator')
    assert elsewhere.status != 0
    assert 'Not found topic access rule for topic ros_discovery_info' in elsewhere.log, (
        elsewhere.log)


SETPOINT = '{header: {frame_id: inertial}, quaternion: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}}'
#: What people type: enclave, command, part of the answer.
COMMANDS = [
    ('/operator', ('node', 'list', '--no-daemon', '--spin-time', '5'), '/attitude_controller'),
    ('/operator', ('topic', 'echo', '--once', '/diagnostics'), 'status:'),
    ('/operator', ('topic', 'pub', '--once', '/attitude_setpoint',
                   'geometry_msgs/msg/QuaternionStamped', SETPOINT), 'publishing #1'),
    ('/operator', ('service', 'call', '/attitude_controller/pause', 'std_srvs/srv/SetBool',
                   '{data: false}'), 'success=True'),
    ('/operator', ('lifecycle', 'get', '--no-daemon', '--spin-time', '5',
                   '/attitude_controller'), 'active'),
    ('/operator', ('param', 'get', '--no-daemon', '--spin-time', '5', '/attitude_controller',
                   'mpc.horizon'), 'Integer value is: 20'),
    ('/recorder', ('topic', 'echo', '--once', '/odometry'), 'orientation'),
]


def test_ordinary_commands_of_operator_and_recorder(site: Site, rig: Rig) -> None:
    """And the recorder calls no service."""
    for program in ('controller', 'simulator'):
        site.start(rig, program)
    for enclave, command, answer in COMMANDS:
        done = site.ros2(enclave, *command)
        assert done.returncode == 0, (command, done.stdout, done.stderr)
        assert answer in done.stdout, (command, done.stdout, done.stderr)
    refused = site.ros2('/recorder', 'service', 'call', '/attitude_controller/reset',
                        'std_srvs/srv/Trigger')
    assert refused.returncode != 0
    assert 'not found in allow rule' in refused.stdout + refused.stderr, refused.stderr


def test_what_a_bag_recorder_opens_is_allowed(site: Site, rig: Rig) -> None:
    """The names of ``ros2 bag record``: its services, its event, which ``-a`` records too."""
    site.start(rig, 'simulator')
    services = ['is_paused', 'pause', 'resume', 'snapshot', 'split_bagfile', 'toggle_paused']
    event = {'/events/write_split': 'std_msgs/msg/String'}
    recorder = Task('rosbag2_recorder', event, event, [f'~/{name}' for name in services])
    done = site.client(replace(recorder, seconds=0.0), '/recorder')
    assert done.status == 0, done.log
    reader = site.client(replace(recorder, publishes={}, subscribes={'/odometry': ODOMETRY},
                                 seconds=PATIENCE_S), '/recorder')
    assert reader.received['/odometry'] > 0, reader.log


def test_several_spacecraft_with_one_keystore(site: Site, rig: Rig) -> None:
    """Each in its namespace; one's operator has no say over the other."""
    for namespace in ('/sat1', '/sat2'):
        for program in ('controller', 'simulator'):
            site.start(rig, program, namespace)
    for namespace in ('/sat1', '/sat2'):
        recorder = site.client(Task('recorder', {}, {
            f'{namespace}/odometry': ODOMETRY, f'{namespace}/torque_command': WRENCH},
            bare=True, seconds=PATIENCE_S), f'{namespace}/recorder')
        assert all(recorder.received.values()), recorder
    call = ('service', 'call', '/sat1/attitude_controller/reset', 'std_srvs/srv/Trigger')
    mine, other = site.ros2('/sat1/operator', *call), site.ros2('/sat2/operator', *call)
    assert mine.returncode == 0, mine.stderr
    assert 'success=True' in mine.stdout
    assert other.returncode != 0
    assert 'not found in allow rule' in other.stdout + other.stderr, other.stderr


def test_enforcement_without_plugins_is_an_error_and_not_a_way_in(tmp_path: Path) -> None:
    """With keys that are none, a node that has to be secure does not start at all."""
    (tmp_path / 'enclaves' / 'attitude_controller').mkdir(parents=True)
    with reserved_domain() as domain:
        done = subprocess.run(
            [sys.executable, '-m', 'manifold_mpc_ros.nodes.controller.main', '--ros-args',
             '--enclave', '/attitude_controller', '-p', 'secure:=true'],
            env=child_environment(domain, **secured(tmp_path)), text=True, check=False,
            capture_output=True, timeout=PATIENCE_S)
    assert done.returncode == 1
    assert 'Traceback' not in done.stderr
    assert 'ecurity' in done.stderr or 'SECURITY' in done.stderr, done.stderr
