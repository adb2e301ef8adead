# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags as people have them: cut, of ROS 1, without schemas, with states that cannot be used."""

from __future__ import annotations

import dataclasses
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from copies import others, thirds
from golden import GOLDEN
from rosbags.rosbag2 import CompressionMode
from rosbags.typesys import Stores, get_typestore
from synthetic import (
    START_NS,
    header,
    make,
    odometry,
    quaternion,
    raw,
    run_messages,
    vector,
)
from test_run import foreign

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.contents import RawMessage
from manifold_mpc_ros.lab.recording.bags.reader import read_bag
from manifold_mpc_ros.lab.recording.bags.run import TopicNames, read_run
from manifold_mpc_ros.lab.recording.bags.verdict import judge
from manifold_mpc_ros.lab.recording.replay_plan import ReplayPlan
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario


def record(code: int, body: bytes) -> bytes:
    """Return a record of MCAP."""
    return struct.pack('<BQ', code, len(body)) + body


def text(value: str) -> bytes:
    return struct.pack('<I', len(value)) + value.encode()


def channel(number: int, topic: str, encoding: str) -> bytes:
    """Return a channel without a schema."""
    return record(4, struct.pack('<HH', number, 0) + text(topic) + text(encoding)
                  + struct.pack('<I', 0))


MESSAGE = record(5, struct.pack('<HIQQ', 900, 0, START_NS, START_NS) + b'{"a": 1}')
ALLOWED = {
    'schemaless': channel(900, '/events', 'json') + MESSAGE,
    'schemaless, no encoding': channel(900, '/events', '') + MESSAGE,
    'a channel twice': 2 * channel(900, '/events', 'protobuf') + MESSAGE,
    'a channel without messages': channel(900, '/silent', 'json'),
    'attachment': record(9, struct.pack('<QQ', 1, 1) + text('a.txt') + text('text/plain')
                         + struct.pack('<Q', 2) + b'hi' + struct.pack('<I', 0)),
    'metadata of others': record(12, text('vehicle') + struct.pack('<I', 0)),
    'private records': record(0x80, b'anything') + record(0xFE, b''),
    'a record of a later version': record(0x30, b'\x00' * 9),
}


@pytest.mark.parametrize('kind', sorted(ALLOWED))
@pytest.mark.parametrize('chunked', [False, True])
def test_records_that_the_format_allows_are_no_damage(
    tmp_path: Path, kind: str, chunked: bool,
) -> None:
    data = (GOLDEN / 'half_turn.mcap').read_bytes()
    after = 8 + 9 + int.from_bytes(data[9:17], 'little')
    more = ALLOWED[kind]
    if chunked:
        more = record(6, struct.pack('<QQQI', 1, 1, len(more), 0) + text('')
                      + struct.pack('<Q', len(more)) + more)
    path = tmp_path / 'bag.mcap'
    path.write_bytes(data[:after] + more + data[after:])
    assert read_bag(path).warnings == ()
    assert judge(read_run(path)).passed


@pytest.mark.parametrize('cut', [0.3, 0.7])
def test_a_packed_file_that_is_cut_is_read_as_far_as_it_goes(tmp_path: Path, cut: float) -> None:
    messages = run_messages(400)
    kinds = {'/odometry': 'nav_msgs/msg/Odometry', '/diagnostics':
             'diagnostic_msgs/msg/DiagnosticArray', '/torque_command':
             'geometry_msgs/msg/WrenchStamped'}
    bag = others(tmp_path / 'bag', thirds(messages), kinds, compression=CompressionMode.FILE)
    whole = len(read_run(bag).states)
    file = bag / 'bag_1.mcap.zstd'
    file.write_bytes(file.read_bytes()[:int(cut * file.stat().st_size)])
    run = read_run(bag)
    assert whole // 2 < len(run.states) < whole
    assert 'bag_1.mcap.zstd: the compressed file ends within its data' in run.warnings
    file.unlink()
    run = read_run(bag)
    assert len(run.states) == pytest.approx(2 * whole / 3, abs=2)
    assert 'bag_1.mcap.zstd: the file is missing' in run.warnings
    file.write_bytes(b'\x28\xb5\x2f\xfdnoise' * 9)
    assert any('the compressed file is damaged' in each for each in read_run(bag).warnings)


@pytest.mark.parametrize('name', ['theirs.bag', 'folder/theirs.bag', 'folder/second.bag'])
def test_a_bag_of_ros_1_is_named_with_its_converter(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(b'#ROSBAG V2.0\n' + bytes(100))
    for path in {file, file.parent if file.parent != tmp_path else file}:
        with pytest.raises(BagError, match=r'a ROS 1 bag; convert it with: rosbags-convert --src'):
            read_bag(path)


def imu(index: int, **fields: Any) -> RawMessage:
    """Return a message of an IMU, whole but for what is given."""
    values = {'header': header(10**9 + index * 10**7), 'orientation': quaternion(0, 0, 0, 1),
              'angular_velocity': vector((0.1, 0.2, 0.3)), 'orientation_covariance': np.zeros(9),
              'angular_velocity_covariance': np.zeros(9)}
    return raw('/imu', START_NS + index, make('sensor_msgs/Imu', **{**values, **fields}))


STRING = 'std_msgs/msg/String'
KINDS = {'/odometry': 'nav_msgs/msg/Odometry', '/diagnostics':
         'diagnostic_msgs/msg/DiagnosticArray', '/torque_command':
         'geometry_msgs/msg/WrenchStamped', '/sat1/attitude_controller/description': STRING}
NOT_GIVEN = np.array([-1.0, *[0.0] * 8])
USELESS: list[tuple[Callable[[int], dict[str, Any]], str]] = [
    (lambda _: {'orientation': quaternion(0, 0, 0, 0)},
     '/imu: 40 of 40: the quaternion (0, 0, 0, 0) is not of unit length'),
    (lambda i: {'orientation': quaternion(0, 0, 0, 0.5 + i / 100)},
     '/imu: 40 of 40: the quaternion (0, 0, 0, 0.5) is not of unit length (the first of them)'),
    (lambda i: {'header': header(0), 'angular_velocity': vector((i, 0, 0))},
     '/imu: 40 of 40: the stamp is zero or negative'),
    (lambda i: {'header': header(-10**9 * i)}, '/imu: 40 of 40: the stamp is zero or negative'),
    (lambda _: {'orientation_covariance': NOT_GIVEN},
     '/imu: 40 of 40: no attitude (orientation_covariance[0] is -1)'),
    (lambda _: {'angular_velocity_covariance': NOT_GIVEN},
     '/imu: 40 of 40: no rate (angular_velocity_covariance[0] is -1)'),
]


@pytest.mark.parametrize(('change', 'reason'), USELESS)
def test_states_that_cannot_be_used_are_one_line_with_their_number(
    tmp_path: Path, change: Callable[[int], dict[str, Any]], reason: str,
) -> None:
    bag = foreign(tmp_path / 'bag', [imu(index, **change(index)) for index in range(40)])
    with pytest.raises(BagError) as caught:
        read_run(bag, TopicNames(state='/imu'))
    assert str(caught.value) == f'{bag}: no state can be read on /imu; {reason}'
    some = foreign(tmp_path / 'some', [
        imu(index, **(change(index) if index % 2 else {})) for index in range(40)])
    run = read_run(some, TopicNames(state='/imu'))
    assert len(run.states) == 20
    assert len(run.warnings) == 1
    assert '/imu: 20 of 40: ' in run.warnings[0]


def test_a_loop_is_said_and_repeats_of_lockstep_are_not(tmp_path: Path) -> None:
    for passes, left_out in ((2, 30), (3, 60)):
        looped = [dataclasses.replace(each, received_ns=START_NS + index) for index, each in
                  enumerate(passes * [each for each in run_messages(30)
                                      if each.topic == '/odometry'])]
        run = read_run(foreign(tmp_path / str(passes), looped))
        assert len(run.states) == 30
        assert run.warnings == ()
        (note,) = run.notes
        assert f'/odometry: {left_out} of {passes * 30} states have stamps that came' in note
    twice = [each for each in run_messages(30) for _ in range(2)]
    assert read_run(foreign(tmp_path / 'twice', twice)).notes == ()


def test_the_torques_that_are_there_are_taken(tmp_path: Path) -> None:
    renamed = [dataclasses.replace(each, topic=each.topic.replace('/torque', '/sat1/torque'))
               for each in run_messages(6)]
    kinds = {'/odometry': 'nav_msgs/msg/Odometry', '/diagnostics':
             'diagnostic_msgs/msg/DiagnosticArray', '/sat1/torque_command':
             'geometry_msgs/msg/WrenchStamped'}
    run = read_run(others(tmp_path / 'one', [renamed], kinds))
    assert (len(run.commands), run.topics.torque) == (6, '/sat1/torque_command')
    kinds['/sat2/torque_command'] = kinds['/sat1/torque_command']
    run = read_run(others(tmp_path / 'two', [renamed], kinds))
    assert len(run.commands) == 0
    assert run.notes == ('torques are on /sat1/torque_command, /sat2/torque_command; --torque '
                         'names those to take',)


def test_a_scenario_judges_a_bag_that_says_nothing_of_itself(tmp_path: Path) -> None:
    """As ros2 bag record -a makes one: from the tenth tick on, no description, no end."""
    states = [raw('/odometry', START_NS + index, odometry(
        10**9 + index * 500_000_000, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
        for index in range(5)]
    others_too = [each for each in run_messages(15)[30:] if each.topic == '/diagnostics']
    bag = foreign(tmp_path / 'bag', [*states, *others_too])
    limits = {'final_error_deg': 1.0, 'fallback_ticks': 0}
    for duration_s, passed in ((2.0, True), (3.0, False)):
        scenario = Scenario.from_text(yaml.safe_dump({
            'description': 'theirs', 'duration_s': duration_s, 'acceptance': limits}), 'theirs')
        verdict = judge(read_run(bag, scenario=scenario), own=False)
        assert [each.name for each in verdict.judgements] == ['recording', *limits]
        assert verdict.passed is passed
    with pytest.raises(BagError, match='--scenario names one'):
        judge(read_run(bag))


def described(lockstep: bool, said: str = '') -> list[RawMessage]:
    """Return a run in which the controller of a namespace has described itself, twice."""
    store = get_typestore(Stores.ROS2_JAZZY)
    texts = ('{}', said or json.dumps({
        'backend': 'c', 'versions': {'numpy': '2'}, 'node': '/sat1/attitude_controller',
        'parameters': {'lockstep': lockstep, 'mpc.horizon': 12}}))
    return [*(RawMessage('/sat1/attitude_controller/description', START_NS, START_NS, bytes(
        store.serialize_cdr(store.types[STRING](text), STRING))) for text in texts),
        *run_messages(6)]


@pytest.mark.parametrize('lockstep', [True, False])
def test_what_the_nodes_say_of_themselves_stands_in(tmp_path: Path, lockstep: bool) -> None:
    """Parameters and backend are those of the bag, and lockstep only where it is proved."""
    run = read_run(others(tmp_path / 'bag', [described(lockstep)], KINDS))
    assert (run.lockstep, run.backend, run.scenario) == (lockstep, 'c', None)
    plan = ReplayPlan.of(run, None, None, None)
    assert plan.parameters['mpc.horizon'] == 12
    assert plan.rate == (None if lockstep else 1.0)
    assert ReplayPlan.of(run, None, None, 3.0).rate == 3.0


@pytest.mark.parametrize('said', ['[]', '{"parameters": 3, "backend": []}', '{"a'])
def test_a_description_that_is_none(tmp_path: Path, said: str) -> None:
    run = read_run(others(tmp_path / 'bag', [described(True, said)], KINDS))
    assert (run.lockstep, run.backend) == (False, '')
    assert len(run.warnings) == (said == '{"a')
    assert ReplayPlan.of(run, None, None, None).rate == 1.0
