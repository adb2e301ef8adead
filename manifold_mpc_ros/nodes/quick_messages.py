# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States from the bytes of messages, quickly: only the numbers that are wanted are read.

rclpy makes objects of every field, covariances included, which takes longer than all else between
a state and its torque. Where the numbers lie is learned from the first message; they are taken
from the bytes of others that have the same form: the same length, byte order and texts.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message, serialize_message

from manifold_mpc_ros.config.description import Part, Steps
from manifold_mpc_ros.control.described.fields import WRONG_FIELD, put, value_at
from manifold_mpc_ros.control.described.source import ReadPart, part_of, part_paths, read_part

#: How numbers lie in CDR, and one of each kind whose bytes are found nowhere else by chance.
_CODES = {'double': 'd', 'float': 'f', 'int32': 'i', 'uint32': 'I', 'int64': 'q', 'uint64': 'Q'}
_MARKS = {'d': -8.15193e-77, 'f': struct.unpack('<f', b'\x9a\x37\xc5\x11')[0],
          'i': 0x5AC396E1, 'I': 0xA5C396E1, 'q': 0x5AC396E1B7D20F83, 'Q': 0xA5C396E1B7D20F83}
_TEXT = '<another text, which no message has>'
#: Bytes of the encapsulation, and of the length before a text.
_HEAD, _LENGTH = 4, 4
#: After so many messages of another form it is learned anew.
_LEARN_AGAIN = 100


class _Known(NamedTuple):
    """A part of a state in messages of one form: how its numbers are taken, and what stays."""

    layout: struct.Struct
    order: tuple[int, ...]
    sample: ReadPart


class QuickMessages:
    """Reads the parts of states that messages of one type hold.

    Arguments
    ---------
    kind
        The type.
    parts
        What is read of each.

    """

    def __init__(self, kind: type, parts: Sequence[Part]) -> None:
        """Know no form yet."""
        self._kind, self._parts = kind, parts
        self._length = 0
        self._same: list[tuple[slice, bytes]] = []
        self._known: dict[int, _Known] = {}
        self._others = 0

    def reader(self, data: bytes, received_ns: int) -> Callable[[Part], ReadPart]:
        """Return what reads a part of a message; that raises what `read_part` raises.

        Raises what rclpy does for bytes that are no message.
        """
        if len(data) == self._length and all(data[where] == same for where, same in self._same):
            return lambda part: _taken(self._known[id(part)], part, data, received_ns)
        message = deserialize_message(data, self._kind)
        if self._others % _LEARN_AGAIN == 0:
            self._learn(message, data)
        self._others += 1
        return lambda part: read_part(part, message, received_ns)

    def _learn(self, message: Any, data: bytes) -> None:
        """Learn the form of a message, unless a sequence is in it, or another kind of number."""
        self._length = 0
        probe = deserialize_message(data, self._kind)
        try:
            texts = [_place_of_text(probe, steps) for steps in _texts(probe, ())]
            self._known = {id(part): _known(part, message, probe) for part in self._parts}
        except (IndexError, KeyError, *WRONG_FIELD):
            return
        self._same = [(where, data[where]) for where in (slice(0, _HEAD), *texts)]
        self._length = len(data)


class QuickWriter:
    """Writes the bytes of messages that differ in some numbers only.

    Arguments
    ---------
    message
        One of them.
    paths
        Where the numbers lie. Raises KeyError or ValueError where one is not found in the bytes.

    """

    def __init__(self, message: Any, paths: Sequence[Steps]) -> None:
        """Learn the form."""
        places = [_place_of_number(message, steps) for steps in paths]
        self._places = [(struct.Struct('<' + code).pack_into, at) for at, code in places]
        self._data = bytearray(serialize_message(message))

    def bytes_of(self, numbers: Sequence[float]) -> bytes:
        """Return the message with these numbers at the paths."""
        for (put_into, offset), number in zip(self._places, numbers, strict=True):
            put_into(self._data, offset, number)
        return bytes(self._data)


def _known(part: Part, message: Any, probe: Any) -> _Known:
    """Return how a part is read of bytes; changes numbers of the probe."""
    places = [_place_of_number(probe, steps) for steps in part_paths(part, message)]
    ranked, layout, end = sorted(places), '<', 0
    for offset, code in ranked:
        layout += f'{offset - end}x{code}'
        end = offset + struct.calcsize('<' + code)
    return _Known(struct.Struct(layout), tuple(map(ranked.index, places)),
                  read_part(part, message, 0))


def _taken(known: _Known, part: Part, data: bytes, received_ns: int) -> ReadPart:
    """Return the part of a message that bytes of a known form are."""
    numbers = known.layout.unpack_from(data)
    return part_of(part, [numbers[i] for i in known.order], received_ns, known.sample)


def _place_of_number(probe: Any, steps: Steps) -> tuple[int, str]:
    """Return where a number lies in bytes, and how; KeyError, ValueError: that cannot be told."""
    owner, name = value_at(probe, steps[:-1]), steps[-1]
    if isinstance(name, int):  # an element of an array
        owner, name = value_at(probe, steps[:-2]), steps[-2]
    code = _CODES[owner.get_fields_and_field_types()[name].partition('[')[0]]
    old, mark = value_at(probe, steps), struct.pack('<' + code, _MARKS[code])
    put(probe, steps, _MARKS[code])
    data = bytes(serialize_message(probe))
    put(probe, steps, old)
    if data.count(mark) != 1:
        raise ValueError(steps)
    return data.index(mark), code


def _place_of_text(probe: Any, steps: Steps) -> slice:
    """Return where the length and the characters of a text lie in bytes."""
    text = value_at(probe, steps)
    put(probe, steps, _TEXT)
    begin = bytes(serialize_message(probe)).index(_TEXT.encode()) - _LENGTH
    put(probe, steps, text)
    return slice(begin, begin + _LENGTH + len(text.encode()) + 1)


def _texts(message: Any, before: Steps) -> Iterator[Steps]:
    """Return the paths of all texts; raises ValueError for what has any other variable length."""
    for name, kind in message.get_fields_and_field_types().items():
        steps = (*before, name)
        if kind.partition('<')[0] == 'string':
            yield steps
        elif hasattr(getattr(message, name), 'get_fields_and_field_types'):
            yield from _texts(getattr(message, name), steps)
        elif 'sequence' in kind or 'string' in kind or '/' in kind:
            raise ValueError(kind)
