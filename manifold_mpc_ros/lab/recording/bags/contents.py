# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a bag holds, storage and damage aside: topics, messages as bytes, notes about the run."""

from __future__ import annotations

import binascii
import json
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

#: The first message of a bag: one std_msgs/String with JSON, `RunDescription`.
DESCRIPTION_TOPIC = '/run_description'
DESCRIPTION_TYPE = 'std_msgs/msg/String'
#: The last message of a bag: one std_msgs/String with JSON, how the recording ended.
END_TOPIC = '/run_end'
#: Keys of custom_data.
CUSTOM_SCENARIO = 'scenario'
CUSTOM_DESCRIPTION = 'run_description'
CUSTOM_OUTCOME = 'outcome'
CUSTOM_CHECKSUMS = 'checksums'

#: One offered QoS profile, by the names of rosbag2's metadata.yaml.
QosProfile = Mapping[str, Any]
#: What the messages about the run are offered with: they are there for whoever comes late.
_ENDLESS = {'sec': 9223372036, 'nsec': 854775807}
LATCHED: QosProfile = {
    'history': 'keep_last', 'depth': 1, 'reliability': 'reliable',
    'durability': 'transient_local', 'deadline': _ENDLESS, 'lifespan': _ENDLESS,
    'liveliness': 'automatic', 'liveliness_lease_duration': _ENDLESS,
    'avoid_ros_namespace_conventions': False,
}


@dataclass(frozen=True)
class BagTopic:
    """One topic: type, type hash (RIHS01, empty when the storage has none), offered profiles."""

    name: str
    kind: str
    type_hash: str = ''
    qos: tuple[QosProfile, ...] = ()

    @property
    def type_in_words(self) -> str:
        """The type, for a sentence; MCAP allows topics without."""
        return f'the type {self.kind}' if self.kind else 'no type'


@dataclass(frozen=True)
class RawMessage:
    """One serialized message with the times of its receipt and, where known, its publication.

    Times are nanoseconds of the system clock. A storage without a field for the time of
    publication (sqlite3) gives the time of receipt for both.
    """

    topic: str
    received_ns: int
    published_ns: int
    data: bytes


def stamp_ns_of(data: bytes) -> int:
    """Return the stamp of a serialized message that begins with a header (or a time) [ns]."""
    order = '<' if data[1] & 1 else '>'
    seconds, rest = struct.unpack_from(f'{order}iI', data, 4)
    return int(seconds) * 1_000_000_000 + int(rest)


@dataclass(frozen=True)
class BagContents:
    """Everything read from a bag, in the order in which it was written.

    ``warnings`` are about damage; ``notes`` about what is no damage but good to know.
    """

    path: Path
    storage: str
    topics: Mapping[str, BagTopic]
    messages: tuple[RawMessage, ...]
    custom: Mapping[str, str]
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def of(self, topic: str) -> list[RawMessage]:
        """Return the messages of one topic."""
        return [message for message in self.messages if message.topic == topic]


class Checksums:
    """A CRC-32 for each topic over everything that belongs to a message but its publication."""

    def __init__(self) -> None:
        """Start with no message."""
        self.values: dict[str, int] = {}

    def add(self, topic: str, received_ns: int, data: bytes) -> None:
        """Take one more message into account."""
        previous = self.values.get(topic, 0)
        stamped = binascii.crc32(received_ns.to_bytes(8, 'little', signed=True), previous)
        self.values[topic] = binascii.crc32(data, stamped)

    @classmethod
    def of(cls, messages: Iterable[RawMessage]) -> Checksums:
        """Return the checksums of messages."""
        checksums = cls()
        for message in messages:
            checksums.add(message.topic, message.received_ns, message.data)
        return checksums


@dataclass(frozen=True)
class RunDescription:
    """Where a bag comes from: scenario, versions, and the parameters both nodes ran with.

    ``scenario_text`` is the YAML to the letter; ``versions`` names package, revision, Python,
    ROS middleware, and every wheel that matters; parameters are as the nodes gave them.
    """

    scenario_name: str = ''
    scenario_text: str = ''
    versions: Mapping[str, str] = field(default_factory=dict)
    backend: str = ''
    controller_parameters: Mapping[str, Any] = field(default_factory=dict)
    simulator_parameters: Mapping[str, Any] = field(default_factory=dict)
    topics: Mapping[str, str] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return it as JSON text."""
        return json.dumps(self.__dict__, indent=1, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> RunDescription:
        """Read it from JSON text, keys of later versions left out; raises ValueError."""
        given = json.loads(text)
        if not isinstance(given, dict):
            raise ValueError('not a JSON object')
        empty = cls()
        known = {name: value for name, value in given.items()
                 if name in empty.__dict__ and isinstance(value, type(empty.__dict__[name]))}
        return cls(**known)
