# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States from the bytes of messages, quickly: only the numbers that are wanted are read.

rclpy makes objects of every field, covariances included, which takes longer than all else between
a state and its torque. Where the numbers lie is learned from the first message; they are taken
from the bytes of others that have the same form: the same length, byte order and texts.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message, serialize_message

from manifold_mpc_ros.config.description import Part, Steps
from manifold_mpc_ros.control.described.fields import WRONG_FIELD
from manifold_mpc_ros.control.described.source import ReadPart, part_paths, read_part

#: How numbers lie in CDR, each at a multiple of its size (OMG DDSI-RTPS, XCDR 1, little-endian).
_CODES = {'boolean': '?', 'octet': 'B', 'uint8': 'B', 'int8': 'b', 'uint16': 'H', 'int16': 'h',
          'uint32': 'I', 'int32': 'i', 'uint64': 'Q', 'int64': 'q', 'float': 'f', 'double': 'd'}
#: What the bytes of such a message begin with; places are counted from behind it.
_HEAD = b'\x00\x01\x00\x00'
#: After so many messages of another form it is learned anew.
_LEARN_AGAIN = 100


class _Known(NamedTuple):
    """A part of a state in messages of one form: how its numbers are taken, and what stays."""

    layout: struct.Struct
    in_order: Callable[[tuple[float, ...]], tuple[float, ...]]
    sample: ReadPart


class QuickMessages:
    """Reads the numbers of the parts of states that messages of one type hold.

    Arguments
    ---------
    kind
        The type.
    parts
        What is read of each, in the order of the answers.

    """

    def __init__(self, kind: type, parts: Sequence[Part]) -> None:
        """Know no form yet."""
        self._kind, self._parts = kind, parts
        self._length = 0
        self._same: list[tuple[slice, bytes]] = []
        self._known: list[_Known] = []
        self._others = 0

    def numbers(self, data: bytes) -> list[tuple[Sequence[float], ReadPart]] | None:
        """Return the numbers of each part, and that part of another message of the same form.

        They are in the order of `part_paths`. None for bytes of another form: see `message`.
        """
        if len(data) == self._length and all(data[where] == same for where, same in self._same):
            return [(known.in_order(known.layout.unpack_from(data)), known.sample)
                    for known in self._known]
        return None

    def message(self, data: bytes) -> Any:
        """Return a message of another form as rclpy makes it; now and then its form is learned.

        Raises what rclpy does for bytes that are no message.
        """
        message = deserialize_message(data, self._kind)
        if self._others % _LEARN_AGAIN == 0:
            self._learn(message, data)
        self._others += 1
        return message

    def _learn(self, message: Any, data: bytes) -> None:
        """Learn the form of a message, unless a sequence is in it, or another kind of number."""
        self._length = 0
        try:
            layout = _Layout(message, data)
            self._known = [_known(part, message, layout) for part in self._parts]
        except (IndexError, KeyError, *WRONG_FIELD):
            return
        places = (slice(0, len(_HEAD)), *layout.texts)
        self._same = [(where, data[where]) for where in places]
        self._length = len(data)


class QuickWriter:
    """Writes the bytes of messages that differ in some numbers only.

    Arguments
    ---------
    message
        One of them.
    paths
        Where the numbers lie. Raises KeyError or ValueError where that in the bytes is not known.

    """

    def __init__(self, message: Any, paths: Sequence[Steps]) -> None:
        """Learn the form."""
        self._data = bytearray(serialize_message(message))
        layout = _Layout(message, self._data)
        places = [layout.numbers[steps] for steps in paths]
        self._places = [(struct.Struct('<' + code).pack_into, at) for at, code in places]
        for where in layout.padding:  # the same bytes for the same numbers
            self._data[where] = bytes(where.stop - where.start)

    def bytes_of(self, numbers: Sequence[float]) -> bytes:
        """Return the message with these numbers at the paths."""
        for (put_into, offset), number in zip(self._places, numbers, strict=True):
            put_into(self._data, offset, number)
        return bytes(self._data)


def _known(part: Part, message: Any, layout: _Layout) -> _Known:
    """Return how a part is read of bytes."""
    places = [layout.numbers[steps] for steps in part_paths(part, message)]
    ranked, taken, end = sorted(places), '<', 0
    for offset, code in ranked:
        taken += f'{offset - end}x{code}'
        end = offset + struct.calcsize('<' + code)
    return _Known(struct.Struct(taken), itemgetter(*map(ranked.index, places)),
                  read_part(part, message, 0))


class _Layout:
    """Where the fields of a message lie in its bytes.

    ``numbers``: place and code by path; ``texts``, their lengths before them; and ``padding``.
    Raises ValueError where a sequence or another kind of text is in it, or for other bytes.
    """

    def __init__(self, message: Any, data: bytes | bytearray) -> None:
        """Walk over the fields in their order."""
        self.numbers: dict[Steps, tuple[int, str]] = {}
        self.texts: list[slice] = []
        self.padding: list[slice] = []
        self._end = len(_HEAD)
        self._walk(message, ())
        if self._end != len(data) or bytes(data[:len(_HEAD)]) != _HEAD:
            raise ValueError(f'{len(data)} bytes, not {self._end}')

    def _walk(self, message: Any, before: Steps) -> None:
        """Place the fields of a message inside."""
        for name, kind in message.get_fields_and_field_types().items():
            value, steps = getattr(message, name), (*before, name)
            base, is_array, count = kind.partition('[')
            if base in _CODES:
                paths = [(*steps, i) for i in range(int(count[:-1]))] if is_array else [steps]
                for path in paths:
                    place = self._place(size := struct.calcsize('<' + _CODES[base]), size)
                    self.numbers[path] = (place.start, _CODES[base])
            elif base.partition('<')[0] == 'string' and not is_array:
                self.texts.append(self._place(4, 4 + len(value.encode()) + 1))
            elif hasattr(value, 'get_fields_and_field_types'):
                self._walk(value, steps)
            else:
                raise ValueError(kind)

    def _place(self, alignment: int, size: int) -> slice:
        """Return the next place at a multiple of the alignment."""
        begin = self._end + -(self._end - len(_HEAD)) % alignment
        if begin > self._end:
            self.padding.append(slice(self._end, begin))
        self._end = begin + size
        return slice(begin, self._end)
