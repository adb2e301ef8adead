# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writing a rosbag2 bag, message by message, so that whatever happens leaves a readable one."""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, WriterError
from rosbags.rosbag2.metadata import parse_qos

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.contents import (
    CUSTOM_CHECKSUMS,
    CUSTOM_DESCRIPTION,
    CUSTOM_SCENARIO,
    DESCRIPTION_TOPIC,
    DESCRIPTION_TYPE,
    END_TOPIC,
    LATCHED,
    BagTopic,
    Checksums,
    RawMessage,
    RunDescription,
)
from manifold_mpc_ros.lab.recording.bags.definitions import learn, standard_types
from manifold_mpc_ros.lab.recording.bags.storage import RecordingSqlite3, RecordingWriter

STORAGES = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}
#: Version of metadata.yaml: ROS 2 Jazzy's.
METADATA_VERSION: Literal[9] = 9
#: Space kept for the end of the bag, given back when the disk is full [byte].
RESERVE_BYTES = 1 << 19
_RESERVE_NAME = '.reserve'


class BagWriter:
    """One bag that is being written; a context manager.

    Leaving the context closes the bag, whatever the reason; `add_custom` and `add_outcome` before
    that. Where the disk is full, a reserve of space is given back so that the bag can still be
    closed, and BagError says so.

    Arguments
    ---------
    path
        Folder of the bag, which must not exist yet.
    storage
        'mcap' or 'sqlite3'.
    compress
        Compress the chunks of MCAP with zstd.

    Raises BagError from every method, when the bag cannot be written.

    """

    def __init__(self, path: Path, storage: str = 'mcap', *, compress: bool = False) -> None:
        """Create the folder and the storage."""
        self.path = path
        self._checksums = Checksums()
        self._connections: dict[str, Connection] = {}
        self._typestore = standard_types()
        self._full = False
        self.count = self._latest_ns = 0
        with self._explained():
            self._writer = RecordingWriter(
                path, version=METADATA_VERSION, storage_plugin=STORAGES[storage])
            if compress:
                self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
            self._reserve = path / _RESERVE_NAME
            self._reserve.write_bytes(os.urandom(RESERVE_BYTES))  # nothing that compresses

    def __enter__(self) -> BagWriter:
        """Return the writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bag."""
        self.close()

    @property
    def topics(self) -> frozenset[str]:
        """Names of the topics that were added."""
        return frozenset(self._connections)

    def knows(self, kind: str) -> bool:
        """Say whether the definition of a type is ROS's own, or in an installed package."""
        return learn(self._typestore, kind)

    def require(self, kinds: Iterable[str]) -> None:
        """Raise BagError unless the definitions of types are at hand."""
        for kind in kinds:
            if not self.knows(kind):
                package = kind.partition('/')[0]
                raise BagError(f'{self.path}: the definition of {kind} is not among those of ROS '
                               f'2 Jazzy, nor in share/{package}/msg below AMENT_PREFIX_PATH')

    def add_topic(self, topic: BagTopic) -> None:
        """Add a topic, with the definition of its type."""
        self.require([topic.kind])
        definition, _ = self._typestore.generate_msgdef(topic.kind, ros_version=2)
        type_hash = topic.type_hash or self._typestore.hash_rihs01(topic.kind)
        with self._explained():
            self._connections[topic.name] = self._writer.add_connection(
                topic.name, topic.kind, msgdef=definition, rihs01=type_hash,
                offered_qos_profiles=parse_qos([dict(profile) for profile in topic.qos]))  # type: ignore[misc]

    def write(self, message: RawMessage) -> None:
        """Write one message of a topic that was added."""
        storage = self._writer.storage
        assert storage is not None
        with self._explained():
            storage.published_ns = message.published_ns  # type: ignore[attr-defined]
            self._writer.write(
                self._connections[message.topic], message.received_ns, message.data)
            self._checksums.add(message.topic, message.received_ns, message.data)
            self._latest_ns = max(self._latest_ns, message.received_ns)
            self.count += 1
            if storage.due:  # type: ignore[attr-defined]
                storage.flush()  # type: ignore[attr-defined]

    def add_text(self, topic: str, text: str, stamp_ns: int) -> None:
        """Write one std_msgs/String of a topic that was added."""
        kind = 'std_msgs/msg/String'
        data = self._typestore.serialize_cdr(self._typestore.types[kind](text), kind)
        self.write(RawMessage(topic, stamp_ns, stamp_ns, bytes(data)))

    def add_custom(self, values: Mapping[str, str]) -> None:
        """Add entries to custom_data of metadata.yaml."""
        for key, value in values.items():
            self._writer.set_custom_data(key, value)

    def add_description(self, description: RunDescription, stamp_ns: int) -> None:
        """Add where the bag comes from to custom_data, and as a message for copies."""
        text = description.to_json()
        self.add_custom({CUSTOM_DESCRIPTION: text, CUSTOM_SCENARIO: description.scenario_text})
        self.add_topic(BagTopic(DESCRIPTION_TOPIC, DESCRIPTION_TYPE, qos=(LATCHED,)))
        self.add_text(DESCRIPTION_TOPIC, text, stamp_ns)

    def add_outcome(self, notes: Mapping[str, str]) -> None:
        """Add how the recording ended to custom_data, and as the last message for copies.

        ``ros2 bag`` copies messages and no custom_data.
        """
        self.add_custom(notes)
        with suppress(BagError):  # a full disk has been told
            self.add_topic(BagTopic(END_TOPIC, DESCRIPTION_TYPE, qos=(LATCHED,)))
            self.add_text(END_TOPIC, json.dumps(dict(notes)), self._latest_ns or time.time_ns())

    def flush(self) -> None:
        """Bring everything so far onto the disk."""
        with self._explained():
            self._writer.storage.flush()  # type: ignore[union-attr]

    def close(self) -> None:
        """Write index and metadata; the bag is then complete. Closing again does nothing."""
        if self._writer.storage is None:
            return
        with self._explained():
            self._reserve.unlink(missing_ok=True)
            self._settle_counts()
            self._writer.set_custom_data(
                CUSTOM_CHECKSUMS, json.dumps(self._checksums.values, sort_keys=True))
            self._writer.close()

    def _settle_counts(self) -> None:
        """Count what a database really has after it was full, and forget the checksums."""
        storage = self._writer.storage
        if self._full and isinstance(storage, RecordingSqlite3):
            self._writer.counts.update(dict.fromkeys(self._writer.counts, 0))
            self._writer.counts.update(storage.counts())
            self._checksums = Checksums()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Turn what the layers below raise into one message; give the reserve back."""
        try:
            yield
        except WriterError as error:
            raise BagError(str(error)) from None
        except (OSError, sqlite3.Error) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            self._full = True
            (self.path / _RESERVE_NAME).unlink(missing_ok=True)
            raise BagError(f'{self.path}: cannot write the bag: {reason}') from None


def remove_bag(path: Path) -> None:
    """Remove a bag that is to be overwritten; raises BagError for anything that is not one."""
    if path.is_dir() and all(_belongs_to_a_bag(file) for file in path.iterdir()):
        shutil.rmtree(path)
    elif path.exists():
        raise BagError(f'{path}: exists and is more, or other, than a bag; it is not overwritten')


def _belongs_to_a_bag(file: Path) -> bool:
    """Say whether a file is one that rosbag2 or this writer makes."""
    return file.is_file() and (file.name in ('metadata.yaml', _RESERVE_NAME)
                               or file.name.partition('.db3')[1] == '.db3'
                               or file.suffix == '.mcap')
