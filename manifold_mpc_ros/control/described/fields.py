# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fields of a message by path: ``pose.pose.orientation``, ``xyz``, ``data[2]``; needs no ROS.

A message is any object with the fields as attributes, as rclpy and `rosbags` make them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from manifold_mpc_ros.config.description import Steps
from manifold_mpc_ros.control.input_gate import NANOSECONDS

#: What reading or writing a field raises that is not there, or is another kind of value.
WRONG_FIELD = (AssertionError, AttributeError, OverflowError, TypeError, ValueError)


def value_at(message: Any, steps: Steps) -> Any:
    """Return the value of a field.

    Raises IndexError where a sequence has no such element now, and else one of WRONG_FIELD.
    """
    for step in steps:
        if isinstance(step, str):
            message = getattr(message, step)
        elif isinstance(message, np.ndarray) and step >= len(message):
            raise ValueError(f'it has {len(message)} elements, not {step + 1}')
        else:
            message = message[step]
    return message


def numbers_at(message: Any, fields: Sequence[Steps], names: str) -> tuple[float, ...]:
    """Return numbers of a message, as many as ``names`` has characters.

    Of several fields each is a number. One field is a message, whose numbers have the names, or
    an array in their order. Raises what `value_at` raises.
    """
    if len(fields) > 1:
        return tuple([float(value_at(message, steps)) for steps in fields])
    value = value_at(message, fields[0])
    if hasattr(value, names[0]):
        return tuple([float(getattr(value, name)) for name in names])
    if len(value) != len(names):
        empty = not len(value) and not isinstance(value, str)
        raise (IndexError if empty else ValueError)(f'{len(value)} numbers, not {len(names)}')
    return tuple(map(float, value))


def number_paths(message: Any, fields: Sequence[Steps], names: str) -> list[Steps]:
    """Return the path of each number that `numbers_at` reads."""
    if len(fields) > 1:
        return list(fields)
    named = hasattr(value_at(message, fields[0]), names[0])
    return [(*fields[0], name if named else i) for i, name in enumerate(names)]


def put_numbers(
    message: Any, fields: Sequence[Steps], names: str, values: Sequence[float],
) -> None:
    """Put numbers where `numbers_at` reads them; without names in an array of any length."""
    target = value_at(message, fields[0])
    if len(fields) > 1:
        for steps, value in zip(fields, values, strict=True):
            put(message, steps, value)
    elif names and hasattr(target, names[0]):
        for name, value in zip(names, values, strict=True):
            setattr(target, name, value)
    else:
        put(message, fields[0], list(values))


def put(message: Any, steps: Steps, value: Any) -> None:
    """Put a value into a field that is there."""
    value_at(message, steps)
    owner, last = value_at(message, steps[:-1]), steps[-1]
    if isinstance(last, int):
        owner[last] = value
    else:
        setattr(owner, last, value)


def stamp_at(message: Any, steps: Steps, unit_ns: int) -> int | None:
    """Return the stamp of a message [ns], of a time or of a number of a unit; None without."""
    if not steps:
        return None
    value = value_at(message, steps)
    if unit_ns:
        return round(value * unit_ns)
    if isinstance(value, (int, float)):
        raise TypeError('the stamp is a number, whose stamp_unit is not given')
    return int(value.sec) * NANOSECONDS + int(value.nanosec)


def stamp_paths(message: Any, steps: Steps) -> list[Steps]:
    """Return the path of each number that `stamp_at` reads."""
    if not steps:
        return []
    if isinstance(value_at(message, steps), (int, float)):
        return [steps]
    return [(*steps, 'sec'), (*steps, 'nanosec')]


def put_stamp(message: Any, steps: Steps, unit_ns: int, stamp_ns: int) -> None:
    """Put a stamp [ns] where `stamp_at` reads it."""
    for path, number in zip(stamp_paths(message, steps),
                            stamp_numbers(message, steps, unit_ns, stamp_ns)):
        put(message, path, number)


def stamp_numbers(message: Any, steps: Steps, unit_ns: int, stamp_ns: int) -> Sequence[float]:
    """Return the numbers of a stamp [ns] that belong at `stamp_paths`."""
    if not steps:
        return ()
    if not unit_ns:
        return divmod(stamp_ns, NANOSECONDS)
    whole = isinstance(value_at(message, steps), int)
    return (stamp_ns // unit_ns if whole else stamp_ns / unit_ns,)
