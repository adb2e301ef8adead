# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replays for real over DDS: golden bags with either backend, changed bags, others' bags."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from golden import GOLDEN, NAMES, truncated, with_odometry_setpoint

from manifold_mpc_ros.cli.processes import node_environment
from manifold_mpc_ros.lab.recording.bags.contents import BagTopic, RawMessage
from manifold_mpc_ros.lab.recording.bags.decode import WRENCH, typestore
from manifold_mpc_ros.lab.recording.bags.reader import read_bag
from manifold_mpc_ros.lab.recording.bags.run import read_run
from manifold_mpc_ros.lab.recording.bags.writer import BagWriter

Command = Callable[..., tuple[int, str, str]]
TOP = Path(__file__).parents[2]
MANIFOLD_MPC = [sys.executable, '-m', 'manifold_mpc_ros.cli.main']


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command without HOME, which it does not need."""
    pytest.importorskip('rclpy')
    path = os.pathsep.join([str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])
    environment = {**node_environment(0), 'PYTHONPATH': path, 'ROS_DOMAIN_ID': ''}
    environment.pop('HOME', None)
    return subprocess.run(
        [*MANIFOLD_MPC, *map(str, arguments)], env=environment, text=True, capture_output=True,
        check=False, timeout=200)


def rewritten(
    bag: Path, path: Path, change: Callable[[RawMessage], RawMessage], *,
    rename: Callable[[BagTopic], BagTopic] = lambda topic: topic, custom: bool = True,
) -> Path:
    """Write a bag again with other messages."""
    contents = read_bag(bag)
    with BagWriter(path, 'sqlite3') as writer:
        for topic in contents.topics.values():
            writer.add_topic(rename(topic))
        for message in contents.messages:
            writer.write(change(message))
        writer.add_custom({key: value for key, value in contents.custom.items()
                           if custom and key != 'checksums'})
    return path


def other_torque(message: RawMessage) -> RawMessage:
    """Return a torque that differs by one part in 1e9 about x."""
    wrench = typestore().deserialize_cdr(message.data, WRENCH)
    wrench.wrench.torque.x += 1e-9  # type: ignore[attr-defined]
    return dataclasses.replace(
        message, data=bytes(typestore().serialize_cdr(wrench, WRENCH)))


@pytest.mark.parametrize('name', NAMES)
def test_golden_bags_give_the_same_torques(name: str) -> None:
    done = run('replay', GOLDEN / f'{name}.mcap', '--tolerance', '1e-9')
    assert (done.returncode, done.stderr) == (0, ''), done.stdout + done.stderr
    commands = read_run(GOLDEN / f'{name}.mcap').commands
    assert f'{len(commands)} recorded torques, 0 of them without an answer' in done.stdout
    assert done.stdout.endswith('PASS\n')


def test_an_odometry_setpoint_is_replayed(tmp_path: Path) -> None:
    # The last recorded plan sees the end of the reference, which the setpoint does not have.
    done = run('replay', with_odometry_setpoint(tmp_path / 'bag'), '--tolerance', '1e-5')
    assert (done.returncode, done.stderr) == (0, ''), done.stdout + done.stderr
    assert '2 setpoints' in done.stdout


def test_a_replay_of_a_fresh_recording_has_the_same_bits_and_a_change_is_shown(
    tmp_path: Path,
) -> None:
    recorded = run('record', GOLDEN / 'noisy_imu.yaml', '-o', tmp_path / 'bag')
    assert recorded.returncode == 0, recorded.stdout + recorded.stderr
    done = run('replay', tmp_path / 'bag', '--tolerance', '0')
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'every bit is the same (asked for: the same bits)' in done.stdout
    stamps = read_run(tmp_path / 'bag').commands.stamp_ns

    def change(message: RawMessage) -> RawMessage:
        if message.topic != '/torque_command':
            return message
        stamp = typestore().deserialize_cdr(message.data, WRENCH).header.stamp  # type: ignore[attr-defined]
        same = stamp.sec * 10**9 + stamp.nanosec == stamps[6]
        return other_torque(message) if same else message

    changed = rewritten(tmp_path / 'bag', tmp_path / 'changed', change)
    done = run('replay', changed, '--tolerance', '0')
    assert done.returncode == 1, done.stdout + done.stderr
    assert f'FAIL: first at tick 7 of {len(stamps)}, 3 s (stamp {stamps[6]}):' in done.stdout
    assert done.stdout.index('  recorded  (') < done.stdout.index('  replayed  (')


def test_a_bag_from_another_stack(tmp_path: Path) -> None:
    """Attitude and rate apart, on other topics and in other frames; its torques are found."""
    pytest.importorskip('rclpy')
    foreign = others_bag(tmp_path / 'theirs')
    refused = run('replay', foreign)
    assert refused.returncode == 2
    assert '/pose (geometry_msgs/msg/PoseStamped)' in refused.stderr
    assert refused.stderr.count('\n') == 1
    arguments = ('--pose', '/pose', '--twist', '/rate')
    done = run('replay', foreign, *arguments)
    assert done.returncode == 1, done.stdout + done.stderr
    assert '6 states, 0 setpoints, 1 times as fast as real time' in done.stdout
    assert 'FAIL: first at tick ' in done.stdout


def others_bag(path: Path) -> Path:
    """Write half a minute of another stack, whose controller commands nothing."""
    types = typestore().types

    def header(index: int) -> object:
        time = types['builtin_interfaces/msg/Time'](10 + index // 2, index % 2 * 500_000_000)
        return types['std_msgs/msg/Header'](time, 'map')

    def vector(x: float) -> object:
        return types['geometry_msgs/msg/Vector3'](x, 0.0, 0.0)

    zero = types['geometry_msgs/msg/Point'](0.0, 0.0, 0.0)
    turned = types['geometry_msgs/msg/Quaternion'](0.6, 0.0, 0.0, 0.8)
    kinds = {'/pose': 'geometry_msgs/msg/PoseStamped', '/rate': 'geometry_msgs/msg/TwistStamped',
             '/wrench': WRENCH}
    contents = {
        '/pose': lambda index: types[kinds['/pose']](
            header(index), types['geometry_msgs/msg/Pose'](zero, turned)),
        '/rate': lambda index: types[kinds['/rate']](
            header(index), types['geometry_msgs/msg/Twist'](vector(0.0), vector(0.01))),
        '/wrench': lambda index: types[WRENCH](
            header(index), types['geometry_msgs/msg/Wrench'](vector(0.0), vector(0.0)))}
    with BagWriter(path) as writer:
        for topic, kind in kinds.items():
            writer.add_topic(BagTopic(topic, kind))
        for index in range(6):
            for topic, make in contents.items():
                data = bytes(typestore().serialize_cdr(make(index), kinds[topic]))
                writer.write(RawMessage(topic, 10**18 + index, 10**18 + index, data))
    return path


def test_at_a_pace() -> None:
    done = run('replay', GOLDEN / 'mistuned.mcap', '--rate', '0.5')  # a tick a second
    assert '0.5 times as fast as real time' in done.stdout
    assert 'at most 0.05 N m' in done.stdout
    assert done.returncode == 0, done.stdout + done.stderr


def test_damage_is_told_and_fails(tmp_path: Path) -> None:
    done = run('replay', truncated('mistuned', tmp_path), '--tolerance', '1e-9')
    assert (done.returncode, done.stderr) == (1, ''), done.stdout + done.stderr
    assert 'damaged: part.mcap: the file cannot be read from byte' in done.stdout
    assert 'FAIL: what could be read of the damaged bag agrees' in done.stdout


def test_mistakes_are_one_line(command: Command, tmp_path: Path) -> None:
    bag = GOLDEN / 'half_turn.mcap'
    for arguments, words in (
        ((tmp_path / 'none',), 'no such bag'),
        ((bag, '--pose', '/pose'), '--pose and --twist go together'),
        ((bag, '--state', '/imu', '--pose', '/pose', '--twist', '/twist'), 'left out with --pose'),
        ((bag, '--tolerance', '-1'), 'is below 0'),
        ((bag, '--rate', '0'), 'is not a number above 0'),
    ):
        status, out, err = command('replay', *arguments)
        assert (status, out) == (2, '')
        assert err.count('\n') == 1
        assert words in err
