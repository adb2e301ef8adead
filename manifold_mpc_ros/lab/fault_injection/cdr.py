# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stamped messages as the bytes that DDS carries (CDR), taken apart and put together again.

The messages that pass between the two nodes are a stamp, then texts, then 64-bit floats: no ROS
is needed to edit one, and one can be made that no ROS library would write.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import NamedTuple

#: Encapsulation header of plain little-endian CDR; alignment counts from behind it.
LITTLE_ENDIAN = b'\x00\x01\x00\x00'
_ORIGIN = len(LITTLE_ENDIAN)


class Part(NamedTuple):
    """Some of the floats of a message, from ``start`` to before ``stop``."""

    start: int
    stop: int


_NOTHING = Part(0, 0)


@dataclass(frozen=True)
class Layout:
    """Where the fields of a message type are: texts after the stamp, then floats."""

    texts: int
    quaternion: Part = _NOTHING
    vector: Part = _NOTHING


#: frame_id, child_frame_id; position 3, orientation 4, covariance 36, linear 3, angular 3, ...
ODOMETRY = Layout(texts=2, quaternion=Part(3, 7), vector=Part(46, 49))
#: frame_id; force 3, torque 3.
WRENCH = Layout(texts=1, vector=Part(3, 6))
#: A bare time.
CLOCK = Layout(texts=0)


@dataclass(frozen=True)
class StampedMessage:
    """A stamp, texts and floats, in the order in which they are serialized."""

    seconds: int
    nanoseconds: int
    texts: tuple[str, ...]
    values: tuple[float, ...]

    @classmethod
    def decode(cls, data: bytes, layout: Layout) -> StampedMessage:
        """Take serialized bytes apart; raises struct.error or ValueError when they are damaged."""
        order = '<' if data[1] & 1 else '>'
        seconds, nanoseconds = struct.unpack_from(f'{order}iI', data, _ORIGIN)
        at, texts = _ORIGIN + 8, []
        for _ in range(layout.texts):
            at = _aligned(at, 4)
            (length,) = struct.unpack_from(f'{order}I', data, at)
            texts.append(data[at + 4:at + 3 + length].decode())
            at += 4 + length
        at = _aligned(at, 8) if len(data) > at else at
        count = max(0, len(data) - at) // 8
        return cls(seconds, nanoseconds, tuple(texts),
                   struct.unpack_from(f'{order}{count}d', data, at))

    def encode(self) -> bytes:
        """Return the serialized bytes, little-endian."""
        data = bytearray(LITTLE_ENDIAN)
        data += struct.pack('<iI', self.seconds, self.nanoseconds)
        for text in self.texts:
            data += bytes(_aligned(len(data), 4) - len(data))
            encoded = text.encode() + b'\0'
            data += struct.pack('<I', len(encoded)) + encoded
        if self.values:
            data += bytes(_aligned(len(data), 8) - len(data))
            data += struct.pack(f'<{len(self.values)}d', *self.values)
        return bytes(data)

    def part(self, where: Part) -> tuple[float, ...]:
        """Return some of the floats."""
        return self.values[where.start:where.stop]

    def with_part(self, where: Part, values: tuple[float, ...]) -> StampedMessage:
        """Return the message with some of its floats replaced."""
        changed = (*self.values[:where.start], *values, *self.values[where.stop:])
        return StampedMessage(self.seconds, self.nanoseconds, self.texts, changed)


def _aligned(at: int, size: int) -> int:
    """Return the next place that is a multiple of ``size`` behind the encapsulation header."""
    return at + (_ORIGIN - at) % size
