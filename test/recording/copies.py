# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of a bag in the forms that ros2 bag makes, and as people leave them."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import yaml
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import zstd  # type: ignore[attr-defined]
from rosbags.typesys import Stores, get_typestore
from synthetic import START_NS

from manifold_mpc_ros.lab.recording.bags.contents import RawMessage
from manifold_mpc_ros.lab.recording.bags.reader import read_bag

Parts = Sequence[Sequence[RawMessage]]


def others(
    folder: Path, parts: Parts, kinds: dict[str, str], *, mcap: bool = True,
    compression: CompressionMode = CompressionMode.NONE,
) -> Path:
    """Write messages as another recorder does, each part in a file of its own, no custom_data."""
    store = get_typestore(Stores.ROS2_JAZZY)
    folder.mkdir(parents=True)
    listed, counts = [], dict.fromkeys(kinds, 0)
    for number, part in enumerate(parts):
        writer = Writer(folder / f'{folder.name}_{number}', version=9,
                        storage_plugin=StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3)
        if compression is not CompressionMode.NONE:
            writer.set_compression(compression, CompressionFormat.ZSTD)
        with writer:
            known = {topic: writer.add_connection(topic, kind, typestore=store)
                     for topic, kind in kinds.items()}
            for message in part:
                writer.write(known[message.topic], message.received_ns, message.data)
                counts[message.topic] += 1
        made = folder / f'{folder.name}_{number}'
        document = yaml.safe_load((made / 'metadata.yaml').read_text(encoding='utf-8'))
        (made / 'metadata.yaml').unlink()
        (file,) = made.iterdir()
        file.rename(folder / file.name)
        made.rmdir()
        listed.append(file.name)
    information = document['rosbag2_bagfile_information']
    information['relative_file_paths'] = listed
    for entry in information['topics_with_message_count']:
        entry['message_count'] = counts[entry['topic_metadata']['name']]
    (folder / 'metadata.yaml').write_text(yaml.safe_dump(document), encoding='utf-8')
    return folder


def played(messages: Sequence[RawMessage]) -> list[RawMessage]:
    """Return messages as a recorder of their playback receives them: later, jittered, mixed up."""
    random = np.random.default_rng(3)
    late = [dataclasses.replace(each, received_ns=START_NS + 3 * (
        each.received_ns - messages[0].received_ns) // 2 + int(random.integers(0, 200_000)))
        for each in messages]
    return sorted(late, key=lambda each: each.received_ns)


def thirds(messages: Sequence[RawMessage]) -> Parts:
    size = len(messages) // 3
    return messages[:size], messages[size:2 * size], messages[2 * size:]


def copies(folder: Path, bag: Path) -> Iterator[tuple[str, Path]]:
    """Yield a bag in every form that ros2 bag makes of it, and as people leave it."""
    contents = read_bag(bag)
    messages = list(contents.messages)
    kinds = {topic.name: topic.kind for topic in contents.topics.values()}
    for mcap in (True, False):
        name = 'mcap' if mcap else 'sqlite3'
        yield f'converted to {name}', others(folder / name, [messages], kinds, mcap=mcap)
        split = others(folder / f'split_{name}', thirds(messages), kinds, mcap=mcap)
        yield f'split, {name}', split
        (split / 'metadata.yaml').unlink()
        yield f'split, {name}, no metadata', split
    for mode in (CompressionMode.FILE, CompressionMode.MESSAGE, CompressionMode.STORAGE):
        packed = others(folder / mode.name, thirds(messages), kinds, compression=mode)
        yield f'compressed, {mode.name}', packed
        yield 'its metadata.yaml', packed / 'metadata.yaml'
    for file in sorted((folder / 'FILE').glob('*.zstd'))[:2]:
        (folder / 'FILE' / file.stem).write_bytes(zstd.decompress(file.read_bytes()))
    yield 'unpacked by hand beside the packed file', folder / 'FILE'
    one = others(folder / 'one', [messages], kinds, mcap=False, compression=CompressionMode.FILE)
    yield 'one packed file', one / 'one_0.db3.zstd'
    yield 'played and recorded', others(folder / 'played', [played(messages)], {
        **kinds, '/events/write_split': 'std_msgs/msg/String'})
    renamed = folder / 'renamed' / 'other.mcap'
    renamed.parent.mkdir()
    shutil.copyfile(bag, renamed)
    yield 'a file alone', renamed
    yield 'its folder', renamed.parent
