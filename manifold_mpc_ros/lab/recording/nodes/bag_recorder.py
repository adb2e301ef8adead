# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An observer that writes every topic of a domain into a bag, byte by byte as it came."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from manifold_mpc_ros.config.tables import CONTROLLER_NAME
from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.contents import BagTopic, RawMessage, stamp_ns_of
from manifold_mpc_ros.lab.recording.bags.writer import BagWriter
from manifold_mpc_ros.lab.recording.nodes.listener import Listener
from manifold_mpc_ros.lab.recording.nodes.raw import (
    StampReader,
    leading_stamp,
    message_class,
    qos_mapping,
)

NODE_NAME = 'bag_recorder'
#: The graph is looked at for new topics, and the bag brought onto the disk, so often [s].
LOOK_PERIOD_S = 0.5
FLUSH_PERIOD_S = 1.0
_DEPTH = 10_000


@dataclass
class TopicCount:
    """What was heard of one topic."""

    received: int = 0
    first_stamp_ns: int = 0
    latest_stamp_ns: int = 0
    latest_sequence: int = 0
    writers: int = 0

    @property
    def lost(self) -> int:
        """Messages that were published and not received; known with one publisher only."""
        return max(0, self.latest_sequence - self.received) if self.writers == 1 else 0


class BagRecorder(Listener):
    """Subscribes to every topic it sees and hands each message to a writer.

    Messages wait in memory until `begin`. With `end_stamp_ns` set, messages of ``stamped``
    topics with a later stamp are left out.

    Arguments
    ---------
    domain_id
        The domain to record.
    writer
        The bag.
    stamped
        Type by name of the topics that are there from the start and whose stamps count.
    others
        Type by name of the other topics that are there from the start.
    stamp_readers
        What reads the stamps of a topic; of the others messages begin with a header.
    use_sim_time
        Whether time of receipt is that of ``/clock``, 0 before it begins.

    """

    def __init__(
        self, domain_id: int, writer: BagWriter, stamped: Mapping[str, str],
        others: Mapping[str, str], stamp_readers: Mapping[str, StampReader] | None = None,
        *, use_sim_time: bool = False,
    ) -> None:
        """Join the domain and subscribe to what is expected."""
        super().__init__(NODE_NAME, domain_id)
        self._writer = writer
        self._stamp_readers = {**dict.fromkeys(stamped, leading_stamp), **(stamp_readers or {})}
        self._clock_ns = 0 if use_sim_time else None
        self._waiting: list[RawMessage] | None = []
        self._kinds: dict[str, str] = {}
        self._counts: dict[str, TopicCount] = {}
        self.unrecorded: dict[str, str] = {}
        self.end_stamp_ns: int | None = None
        self.controller: dict[str, str] = {}
        self._failure: BagError | None = None
        self._looked_s = self._flushed_s = time.monotonic()
        for name, kind in {**stamped, **others}.items():
            self._subscribe(name, kind)

    def __enter__(self) -> BagRecorder:
        """Return the recorder."""
        return self

    def count(self, topic: str) -> TopicCount:
        """Return what was heard of a topic."""
        return self._counts.setdefault(topic, TopicCount())

    @property
    def first_receipt_ns(self) -> int:
        """When the first message that waits came, now if none does [ns of the system clock]."""
        return self._waiting[0].received_ns if self._waiting else time.time_ns()

    def begin(self, first_stamp_ns: int = 0) -> None:
        """Write what has waited, and everything else as it comes.

        Of ``stamped`` topics, what has an earlier stamp than ``first_stamp_ns`` is left out.
        """
        waiting, self._waiting = self._waiting or [], None
        for message in waiting:
            stamp_of = self._stamp_readers.get(message.topic)
            if stamp_of is None or stamp_of(message.data, message.received_ns) >= first_stamp_ns:
                self._write(message)

    def tend(self) -> None:
        """Do what is due now and then; raises BagError when the bag cannot be written."""
        if self._failure is not None:
            raise self._failure
        self.look()
        now_s = time.monotonic()
        if now_s - self._flushed_s >= FLUSH_PERIOD_S and self._waiting is None:
            self._flushed_s = now_s
            self._writer.flush()

    def lost(self) -> dict[str, int]:
        """Return how many messages of the stamped topics were missed, by topic."""
        return {name: count.lost for name, count in sorted(self._counts.items())
                if name in self._stamp_readers and count.lost}

    def look(self) -> None:
        """Subscribe to topics that are new, now and then."""
        now_s = time.monotonic()
        if now_s - self._looked_s < LOOK_PERIOD_S:
            return
        self._looked_s = now_s
        for name, kinds in self.node.get_topic_names_and_types():
            if name not in self._kinds and name not in self.unrecorded:
                self._subscribe(name, kinds[0])
        for name, count in self._counts.items():
            count.writers = max(count.writers, self.node.count_publishers(name))

    def _subscribe(self, name: str, kind: str) -> None:
        """Subscribe to one topic, asking for no more than its publishers offer."""
        message = message_class(kind)
        if message is None or not self._writer.knows(kind):
            self.unrecorded[name] = kind
            return
        offered = [info.qos_profile for info in self.node.get_publishers_info_by_topic(name)]
        reliable = all(each.reliability == ReliabilityPolicy.RELIABLE for each in offered)
        latched = bool(offered) and all(
            each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in offered)
        profile = QoSProfile(
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE)
        self._kinds[name] = kind

        def on_message(data: bytes, info: Mapping[str, Any]) -> None:
            self._on_message(name, data, info)

        self.subscribe(message, name, on_message, profile, raw=True)

    def _on_message(self, name: str, data: bytes, info: Mapping[str, Any]) -> None:
        """Count and write one message."""
        count = self.count(name)
        count.received += 1
        count.latest_sequence = max(count.latest_sequence,
                                    info.get('publication_sequence_number') or 0)
        received_ns = info.get('received_timestamp') or time.time_ns()
        if name in self._stamp_readers:
            time_ns = received_ns if self._clock_ns is None else self._clock_ns
            stamp_ns = self._stamp_readers[name](data, time_ns)
            count.first_stamp_ns = count.first_stamp_ns or stamp_ns
            count.latest_stamp_ns = max(count.latest_stamp_ns, stamp_ns)
            if self.end_stamp_ns is not None and stamp_ns > self.end_stamp_ns:
                return
        elif name == '/diagnostics':
            self._note_diagnostics(data)
        elif name == '/clock' and self._clock_ns is not None:
            self._clock_ns = stamp_ns_of(data)
        message = RawMessage(
            name, received_ns, info.get('source_timestamp') or received_ns, data)
        if self._waiting is None:
            self._write(message)
        else:
            self._waiting.append(message)

    def _note_diagnostics(self, data: bytes) -> None:
        """Remember what the controller last said about itself."""
        for status in deserialize_message(data, DiagnosticArray).status:
            if status.name.rpartition('/')[2] == CONTROLLER_NAME:
                self.controller = {pair.key: pair.value for pair in status.values}

    def _write(self, message: RawMessage) -> None:
        """Write one message; a failure is kept for `tend`, out of the executor."""
        if self._failure is not None or message.topic in self.unrecorded:
            return
        try:
            if message.topic not in self._writer.topics:
                self._add_topic(message.topic)
            self._writer.write(message)
        except BagError as error:
            self._failure = error

    def _add_topic(self, name: str) -> None:
        """Add a topic to the bag with what its publishers offer."""
        offered = self.node.get_publishers_info_by_topic(name)
        hashes = {str(info.topic_type_hash) for info in offered}
        self._writer.add_topic(BagTopic(
            name, self._kinds[name], hashes.pop() if len(hashes) == 1 else '',
            tuple(qos_mapping(info.qos_profile) for info in offered)))
