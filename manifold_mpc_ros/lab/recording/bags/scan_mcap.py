# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A scan of an MCAP file from front to back that keeps what it can read.

It needs no index, so a file without an end is read up to where it ends; chunks are checked
against their checksums. Record layouts: https://mcap.dev/spec. The readers of the package mcap
end at the first damage, this one reads on behind it (docs/libraries.md).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import yaml
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.storage_mcap import decompress, zstd  # type: ignore[attr-defined]

from manifold_mpc_ros.lab.recording.bags.contents import BagTopic, QosProfile, RawMessage

_MAGIC = b'\x89MCAP0\r\n'
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06
_METADATA, _DATA_END = 0x0C, 0x0F
#: Larger than any record of ours; a longer one is a damaged length [byte].
_LONGEST = 1 << 32


@dataclass
class Scan:
    """What one storage file gave: topics, messages, its copy of the metadata, what was wrong."""

    topics: dict[str, BagTopic] = field(default_factory=dict)
    messages: list[RawMessage] = field(default_factory=list)
    metadata_text: str = ''
    problems: list[str] = field(default_factory=list)


class _Fields:
    """Reads the fields of one record in order; raises struct.error beyond its end."""

    def __init__(self, data: bytes) -> None:
        """Start at the first byte."""
        self._data, self._at = data, 0

    def take(self, form: str) -> tuple[int, ...]:
        """Return little-endian integers."""
        values = struct.unpack_from(f'<{form}', self._data, self._at)
        self._at += struct.calcsize(f'<{form}')
        return values

    def raw(self, size: int) -> bytes:
        """Return so many bytes."""
        if size > len(self._data) - self._at:
            raise struct.error('a field reaches beyond its record')
        self._at += size
        return self._data[self._at - size:self._at]

    def text(self) -> str:
        """Return a string."""
        return self.raw(self.take('I')[0]).decode()

    def pairs(self) -> Mapping[str, str]:
        """Return a map of strings."""
        inner = _Fields(self.raw(self.take('I')[0]))
        pairs = {}
        while inner.left():
            key = inner.text()
            pairs[key] = inner.text()
        return pairs

    def left(self) -> bytes:
        """Return what has not been read."""
        return self._data[self._at:]


class _Scanner:
    """Takes in record after record."""

    def __init__(self) -> None:
        """Start with nothing."""
        self.scan = Scan()
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, str] = {}
        self.ended = False

    def read(self, data: bytes, start: int, *, inside: bool = False) -> None:
        """Take in the records of a file from ``start`` on, or those of a chunk."""
        for at, code, body in self._records(data, start, inside):
            try:
                self._take(code, body)
            except (ReaderError, struct.error, ValueError, EOFError, RuntimeError,
                    MemoryError, OverflowError, yaml.YAMLError, KeyError, TypeError,
                    zstd.ZstdError) as error:
                where = 'in a chunk' if inside else f'at byte {at}'
                self._note(f'a record {where} is damaged and left out ({_words(error)})')
            if self.ended:
                return

    def _records(self, data: bytes, at: int, inside: bool) -> Iterator[tuple[int, int, bytes]]:
        """Yield (position, opcode, body) for each record that is all there."""
        while at < len(data):
            head = data[at:at + 9]
            size = int.from_bytes(head[1:], 'little')
            if len(head) < 9 or size > min(_LONGEST, len(data) - at - 9):
                self._note('a chunk ends within a record' if inside else
                           f'the file cannot be read from byte {at} on (of {len(data)})')
                self.ended = self.ended or not inside
                return
            yield at, head[0], data[at + 9:at + 9 + size]
            at += 9 + size

    def _take(self, code: int, body: bytes) -> None:
        """Take in one record."""
        fields = _Fields(body)
        if code == _CHUNK:
            _, _, size, crc = fields.take('QQQI')
            compression = fields.text()
            packed = fields.raw(fields.take('Q')[0])
            self.read(decompress(packed, compression, size, crc), 0, inside=True)
        elif code == _MESSAGE:
            channel, _, received_ns, published_ns = fields.take('HIQQ')
            self.scan.messages.append(RawMessage(
                self._channels[channel], _signed(received_ns), _signed(published_ns),
                fields.left()))
        elif code == _SCHEMA:
            (number,) = fields.take('H')
            self._schemas[number] = fields.text()
        elif code == _CHANNEL:
            self._take_channel(fields)
        elif code == _METADATA:
            if fields.text() == 'rosbag2':
                self.scan.metadata_text = fields.pairs().get('serialized_metadata', '')
        elif code in (_DATA_END, _FOOTER):
            self.ended = True

    def _take_channel(self, fields: _Fields) -> None:
        """Take in a topic."""
        number, schema = fields.take('HH')
        name = fields.text()
        encoding = fields.text()
        pairs = fields.pairs()
        self._channels[number] = name
        kind = self._schemas[schema] if schema else ''  # a channel need not have a schema
        kind = kind if encoding in ('cdr', '') else f'{kind} ({encoding})'.strip()
        self.scan.topics[name] = BagTopic(
            name, kind, pairs.get('topic_type_hash', ''),
            qos_profiles(pairs.get('offered_qos_profiles', '')))

    def _note(self, problem: str) -> None:
        """Remember what was wrong, each thing once."""
        if problem not in self.scan.problems:
            self.scan.problems.append(problem)


def scan_mcap(path: Path) -> Scan:
    """Return what an MCAP file holds; raises OSError, and nothing for what is in the file."""
    data = path.read_bytes()
    scanner = _Scanner()
    if data[:8] != _MAGIC:
        scanner.scan.problems.append('the file does not begin like an MCAP file')
        return scanner.scan
    scanner.read(data, 8)
    if not scanner.ended:
        scanner.scan.problems.append('the file ends without an index (the recorder was killed?)')
    return scanner.scan


def qos_profiles(given: object) -> tuple[QosProfile, ...]:
    """Return QoS profiles, which metadata holds as a list or as YAML text of one."""
    items = yaml.safe_load(given) if isinstance(given, str) else given
    return tuple(item for item in (items if isinstance(items, list) else ())
                 if isinstance(item, Mapping))


def _signed(stamp: int) -> int:
    """Return a time within the range of signed 64 bits; beyond it is damage."""
    if stamp >= 1 << 63:
        raise ValueError('a time of message is beyond the year 2262')
    return stamp


def _words(error: BaseException) -> str:
    """Return an error as one line."""
    return ' '.join(str(error).split())[:160] or type(error).__name__
