# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is written is what is read: bytes, stamps, types, profiles; by us and by other readers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from golden import GOLDEN, NAMES
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import Reader
from synthetic import KINDS, QOS, START_NS, STORAGES, run_messages, write_bag

from manifold_mpc_ros.lab.recording.bags.contents import DESCRIPTION_TOPIC, BagContents, RawMessage
from manifold_mpc_ros.lab.recording.bags.reader import read_bag
from manifold_mpc_ros.lab.recording.bags.storage import CHUNK_BYTES
from manifold_mpc_ros.lab.recording.bags.writer import BagWriter

MESSAGES = run_messages(5)


def rewrite(
    contents: BagContents, path: Path, storage: str, *, compress: bool = False,
) -> BagContents:
    """Write everything that was read into another bag; read that."""
    with BagWriter(path, storage, compress=compress) as writer:
        for topic in contents.topics.values():
            writer.add_topic(topic)
        for message in contents.messages:
            writer.write(message)
        writer.add_custom(contents.custom)
    return read_bag(path)


@pytest.mark.parametrize('second', STORAGES)
@pytest.mark.parametrize('first', STORAGES)
def test_write_read_rewrite(first: str, second: str, tmp_path: Path) -> None:
    one = read_bag(write_bag(tmp_path / 'one', MESSAGES, first))
    other = rewrite(one, tmp_path / 'other', second)
    assert (one.storage, other.storage) == (first, second)
    assert one.warnings == other.warnings == ()
    assert dict(one.topics) == dict(other.topics)
    assert dict(one.custom) == dict(other.custom)
    read = [m for m in one.messages if m.topic != DESCRIPTION_TOPIC]
    if first == 'mcap':
        assert read == MESSAGES
    else:  # no field for the time of publication
        assert read == [replace(m, published_ns=m.received_ns) for m in MESSAGES]
    assert [(m.topic, m.received_ns, m.data) for m in one.messages] == [
        (m.topic, m.received_ns, m.data) for m in other.messages]
    if first == second:
        assert one.messages == other.messages


@given(st.lists(st.tuples(st.sampled_from(['/odometry', '/imu']),
                          st.integers(0, 2**62), st.integers(0, 2**62),
                          st.binary(min_size=4, max_size=40)), max_size=12))
@settings(max_examples=20, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_in_any_order(
    tmp_path_factory: pytest.TempPathFactory, given_messages: list[tuple[str, int, int, bytes]],
) -> None:
    messages = [RawMessage(*values) for values in given_messages]
    path = tmp_path_factory.mktemp('any') / 'bag'
    contents = read_bag(write_bag(path, messages))
    assert [m for m in contents.messages if m.topic != DESCRIPTION_TOPIC] == messages
    assert contents.warnings == ()


@pytest.mark.parametrize('storage', STORAGES)
def test_the_library_reads_the_same(storage: str, tmp_path: Path) -> None:
    path = write_bag(tmp_path / 'bag', MESSAGES, storage)
    with Reader(path) as reader:
        read = [(c.topic, c.msgtype, stamp, bytes(data)) for c, stamp, data in reader.messages()]
        profiles = [c.ext.offered_qos_profiles for c in reader.connections]
        assert all(c.digest.startswith('RIHS01_') and c.msgdef.data for c in reader.connections)
    written = [(m.topic, KINDS[m.topic], m.received_ns, m.data) for m in MESSAGES]
    assert sorted(r for r in read if r[0] != DESCRIPTION_TOPIC) == sorted(written)
    assert [len(each) for each in profiles] == [0, 1, 1, 1]


def test_the_reference_reader_of_mcap_reads_the_same(tmp_path: Path) -> None:
    reader = pytest.importorskip('mcap.reader')
    path = write_bag(tmp_path / 'bag', MESSAGES)
    with (path / 'bag_0.mcap').open('rb') as file:
        mcap = reader.make_reader(file, validate_crcs=True)
        assert mcap.get_header().profile == 'ros2'
        assert mcap.get_summary().statistics.message_count == len(MESSAGES) + 1
        read = [(channel.topic, m.log_time, m.publish_time, m.data, schema.name, schema.encoding)
                for schema, channel, m in mcap.iter_messages(log_time_order=False)]
    assert [r for r in read if r[0] != DESCRIPTION_TOPIC] == [
        (m.topic, m.received_ns, m.published_ns, m.data, KINDS[m.topic], 'ros2msg')
        for m in MESSAGES]


@pytest.mark.parametrize('storage', STORAGES)
def test_metadata_is_what_rosbag2_specifies(storage: str, tmp_path: Path) -> None:
    path = write_bag(tmp_path / 'bag', MESSAGES, storage)
    document = yaml.safe_load((path / 'metadata.yaml').read_text(encoding='utf-8'))
    info = document['rosbag2_bagfile_information']
    assert info['version'] == 9
    assert info['storage_identifier'] == storage
    assert info['message_count'] == len(MESSAGES) + 1
    assert info['starting_time'] == {'nanoseconds_since_epoch': START_NS}
    assert info['duration'] == {'nanoseconds': max(m.received_ns for m in MESSAGES) - START_NS}
    assert info['relative_file_paths'] == [file['path'] for file in info['files']]
    assert all((path / name).is_file() for name in info['relative_file_paths'])
    topics = {each['topic_metadata']['name']: each for each in info['topics_with_message_count']}
    odometry = topics['/odometry']
    assert odometry['message_count'] == 5
    assert odometry['topic_metadata'] == {
        'name': '/odometry', 'type': 'nav_msgs/msg/Odometry', 'serialization_format': 'cdr',
        'offered_qos_profiles': [QOS], 'type_description_hash':
            'RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0'}
    assert sorted(file.name for file in path.iterdir()) == sorted(
        ['metadata.yaml', *info['relative_file_paths']])


def test_a_long_run_has_many_chunks(tmp_path: Path) -> None:
    messages = run_messages(200)
    path = write_bag(tmp_path / 'bag', messages)
    assert (path / 'bag_0.mcap').stat().st_size > 2 * CHUNK_BYTES
    assert list(read_bag(path).messages[1:]) == messages


@pytest.mark.parametrize('mode', ['MESSAGE', 'FILE', 'STORAGE'])
def test_compressed_bags_of_others(mode: str, tmp_path: Path) -> None:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore
    writer = Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    store = get_typestore(Stores.ROS2_JAZZY)
    with writer:
        connections = {topic: writer.add_connection(topic, kind, typestore=store)
                       for topic, kind in KINDS.items()}
        for message in MESSAGES:
            writer.write(connections[message.topic], message.received_ns, message.data)
    contents = read_bag(tmp_path / 'bag')
    assert contents.warnings == ()
    assert [(m.topic, m.received_ns, m.data) for m in contents.messages] == [
        (m.topic, m.received_ns, m.data) for m in MESSAGES]


@pytest.mark.parametrize('name', NAMES)
def test_golden_bags_come_through_every_storage(name: str, tmp_path: Path) -> None:
    """Golden bags are compressed; they are the same without, and compressed again."""
    golden = read_bag(GOLDEN / f'{name}.mcap')
    assert golden.warnings == ()
    plain = rewrite(golden, tmp_path / 'plain', 'mcap')
    again = rewrite(plain, tmp_path / 'again', 'mcap', compress=True)
    database = rewrite(golden, tmp_path / 'database', 'sqlite3')
    for other in (plain, again):
        assert other.messages == golden.messages
        assert other.topics == golden.topics
    timed = [(each.topic, each.received_ns, each.data) for each in golden.messages]
    assert [(each.topic, each.received_ns, each.data) for each in database.messages] == timed
    assert size(tmp_path / 'again') < 0.6 * size(tmp_path / 'plain')


def size(bag: Path) -> int:
    """Return the size of a bag's storage file."""
    return next(bag.glob('*.mcap')).stat().st_size
