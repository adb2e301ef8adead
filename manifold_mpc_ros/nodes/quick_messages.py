# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages from their bytes, quickly: of the next one only the numbers that are wanted are read.

rclpy makes objects of every field, covariances included, which takes longer than all else between
a state and its torque. Once it has made one message, the wanted numbers of others are put into
that one, if their bytes have the same form: the same length, byte order and texts.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message, serialize_message

from manifold_mpc_ros.config.description import Steps
from manifold_mpc_ros.control.described.fields import put, value_at

#: How numbers lie in CDR, and one of each kind whose bytes are found nowhere else by chance.
_CODES = {'double': '<d', 'float': '<f', 'int32': '<i', 'uint32': '<I', 'int64': '<q',
          'uint64': '<Q'}
_MARKS = {'<d': -8.15193e-77, '<f': struct.unpack('<f', b'\x9a\x37\xc5\x11')[0],
          '<i': 0x5AC396E1, '<I': 0xA5C396E1, '<q': 0x5AC396E1B7D20F83, '<Q': 0xA5C396E1B7D20F83}
_TEXT = '<another text, which no message has>'
#: Bytes of the encapsulation, and of the length before a text.
_HEAD, _LENGTH = 4, 4
#: After so many messages of another form it is learned anew.
_LEARN_AGAIN = 100


class _Number(NamedTuple):
    """What puts a number into a message, what takes it from bytes, and where it lies there."""

    put: Callable[[float], None]
    take: Callable[[bytes, int], tuple[float]]
    offset: int


class _Form(NamedTuple):
    """What bytes of a form have in common, and where the numbers lie in them."""

    length: int
    same: tuple[tuple[slice, bytes], ...]
    numbers: tuple[_Number, ...]

    def fits(self, data: bytes) -> bool:
        """Return whether bytes have this form."""
        return len(data) == self.length and all(data[where] == text for where, text in self.same)


class QuickMessages:
    """Makes messages of one type from their bytes.

    Arguments
    ---------
    kind
        The type.
    wanted
        Maps a message to the paths of the numbers that are read of it; the others may be old.

    """

    def __init__(self, kind: type, wanted: Callable[[Any], Sequence[Steps]]) -> None:
        """Know no form yet."""
        self._kind, self._wanted = kind, wanted
        self._message: Any = None
        self._form: _Form | None = None
        self._others = 0

    def message(self, data: bytes) -> Any:
        """Return the message; it is good until the next call.

        Raises what rclpy does for bytes that are none.
        """
        form = self._form
        if form is None or not form.fits(data):
            return self._other(data)
        for number in form.numbers:
            number.put(*number.take(data, number.offset))
        return self._message

    def _other(self, data: bytes) -> Any:
        """Return the message of another form, and learn that now and then."""
        message = deserialize_message(data, self._kind)
        if self._others % _LEARN_AGAIN == 0:
            self._message = deserialize_message(data, self._kind)
            self._form = _form_of(self._message, self._wanted(message))
            if self._form is not None and not self._form.fits(data):
                self._form = None
        self._others += 1
        return message


def _form_of(message: Any, wanted: Sequence[Steps]) -> _Form | None:
    """Return the form of a message; None where a sequence or another kind of number is in it."""
    try:
        texts = list(_texts(message, ()))
        numbers = [_number(message, steps) for steps in dict.fromkeys(wanted)]
    except (KeyError, ValueError):
        return None
    data = bytes(serialize_message(message))
    same = [slice(0, _HEAD)]
    for steps in texts:
        text = value_at(message, steps)
        put(message, steps, _TEXT)
        begin = bytes(serialize_message(message)).index(_TEXT.encode()) - _LENGTH
        put(message, steps, text)
        same.append(slice(begin, begin + _LENGTH + len(text.encode()) + 1))
    return _Form(len(data), tuple((where, data[where]) for where in same), tuple(numbers))


def _number(message: Any, steps: Steps) -> _Number:
    """Return where a number lies; raises KeyError or ValueError where that cannot be told."""
    owner, last, old = value_at(message, steps[:-1]), steps[-1], value_at(message, steps)
    in_array = isinstance(last, int)
    has_type, name = (value_at(message, steps[:-2]), steps[-2]) if in_array else (owner, last)
    code = _CODES[has_type.get_fields_and_field_types()[name].partition('[')[0]]
    put(message, steps, _MARKS[code])
    data = bytes(serialize_message(message))
    put(message, steps, old)
    mark = struct.pack(code, _MARKS[code])
    if data.count(mark) != 1:
        raise ValueError(steps)
    setter = owner.__setitem__ if in_array else functools.partial(setattr, owner)
    return _Number(functools.partial(setter, last), struct.Struct(code).unpack_from,
                   data.index(mark))


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
