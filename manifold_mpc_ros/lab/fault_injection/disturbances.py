# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can happen to messages on their way: lost, late, twice, swapped, edited, garbled.

A disturbance maps one message (its bytes) to what is delivered in its place, each with a delay;
it draws from the generator that it is given. Pure logic; the caller hands in the time [s].
"""

from __future__ import annotations

import heapq
import itertools
import math
import random
import struct
from collections.abc import Callable
from dataclasses import replace

from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.lab.fault_injection.cdr import Layout, Part, StampedMessage

#: (delay [s], bytes) of each message that is delivered in the place of one.
Deliveries = list[tuple[float, bytes]]
Disturbance = Callable[[bytes, random.Random], Deliveries]
MakeDisturbance = Callable[[], Disturbance]
Edit = Callable[[StampedMessage, random.Random], StampedMessage]
Garble = Callable[[bytes, random.Random], bytes]

#: An overtaken or repeated message comes so long after the other one: a reader that keeps the
#: newest alone has to see both [s].
_BEHIND_S = 0.004


class Channel:
    """A way from one topic to another that a disturbance acts on while there is one."""

    def __init__(self, seed: int) -> None:
        """Start undisturbed."""
        self.disturbance: Disturbance | None = None
        #: Delays are so many times as long, as the steps of nodes that were slowed down are.
        self.stretch = 1
        self._draws = random.Random(seed)
        self._order = itertools.count()
        self._waiting: list[tuple[float, int, bytes]] = []

    def push(self, data: bytes, now_s: float) -> list[bytes]:
        """Take a message in; return what is to be delivered at once."""
        if self.disturbance is None:
            return [data]
        at_once = []
        for delay_s, delivered in self.disturbance(data, self._draws):
            if delay_s <= 0.0:
                at_once.append(delivered)
            else:
                heapq.heappush(
                    self._waiting, (now_s + self.stretch * delay_s, next(self._order), delivered))
        return at_once

    def due(self, now_s: float) -> list[bytes]:
        """Return the late messages whose time has come."""
        due = []
        while self._waiting and self._waiting[0][0] <= now_s:
            due.append(heapq.heappop(self._waiting)[2])
        return due


def lost(probability: float = 1.0, most_in_a_row: int | None = None) -> MakeDisturbance:
    """Lose each message with a probability, not more than so many in a row."""
    def make() -> Disturbance:
        in_a_row = 0

        def disturb(data: bytes, draws: random.Random) -> Deliveries:
            nonlocal in_a_row
            is_lost = draws.random() < probability and in_a_row != most_in_a_row
            in_a_row = in_a_row + 1 if is_lost else 0
            return [] if is_lost else [(0.0, data)]
        return disturb
    return make


def late(least_s: float, most_s: float) -> MakeDisturbance:
    """Delay each message by an even draw between two bounds [s]; later ones may overtake it."""
    def disturb(data: bytes, draws: random.Random) -> Deliveries:
        return [(draws.uniform(least_s, most_s), data)]
    return lambda: disturb


def repeated(times: int) -> MakeDisturbance:
    """Deliver each message several times."""
    def disturb(data: bytes, _draws: random.Random) -> Deliveries:
        return [(_BEHIND_S * index, data) for index in range(times)]
    return lambda: disturb


def swapped() -> Disturbance:
    """Deliver every two messages in the other order."""
    kept: list[bytes] = []

    def disturb(data: bytes, _draws: random.Random) -> Deliveries:
        if not kept:
            kept.append(data)
            return []
        return [(0.0, data), (_BEHIND_S, kept.pop())]
    return disturb


def frozen() -> Disturbance:
    """Deliver the first message again and again: the publisher is stuck."""
    first: list[bytes] = []

    def disturb(data: bytes, _draws: random.Random) -> Deliveries:
        if not first:
            first.append(data)
        return [(0.0, first[0])]
    return disturb


def edited(layout: Layout, edit: Edit, probability: float = 1.0) -> MakeDisturbance:
    """Edit the fields of each message with a probability."""
    def disturb(data: bytes, draws: random.Random) -> Deliveries:
        if draws.random() >= probability:
            return [(0.0, data)]
        return [(0.0, edit(StampedMessage.decode(data, layout), draws).encode())]
    return lambda: disturb


def garbled(garble: Garble) -> MakeDisturbance:
    """Replace the bytes of each message."""
    def disturb(data: bytes, draws: random.Random) -> Deliveries:
        return [(0.0, garble(data, draws))]
    return lambda: disturb


def some_part(where: Part, value: float) -> Edit:
    """Put a value into one of some floats, drawn."""
    def edit(message: StampedMessage, draws: random.Random) -> StampedMessage:
        values = list(message.part(where))
        values[draws.randrange(len(values))] = value
        return message.with_part(where, tuple(values))
    return edit


def scaled(where: Part, factor: float) -> Edit:
    """Multiply some floats."""
    def edit(message: StampedMessage, _draws: random.Random) -> StampedMessage:
        return message.with_part(where, tuple(factor * x for x in message.part(where)))
    return edit


def filled(where: Part, value: float) -> Edit:
    """Put one value into all of some floats."""
    def edit(message: StampedMessage, _draws: random.Random) -> StampedMessage:
        return message.with_part(where, (value,) * len(message.part(where)))
    return edit


def noisy(where: Part, deviation: float, *, unit: bool = False) -> Edit:
    """Add Gaussian noise to some floats; ``unit`` normalises them afterwards."""
    def edit(message: StampedMessage, draws: random.Random) -> StampedMessage:
        values = [x + draws.gauss(0.0, deviation) for x in message.part(where)]
        norm = math.hypot(*values) if unit else 1.0
        return message.with_part(where, tuple(x / norm for x in values))
    return edit


def random_sign(where: Part) -> Edit:
    """Multiply some floats by 1 or -1, drawn: the two quaternions of an attitude."""
    def edit(message: StampedMessage, draws: random.Random) -> StampedMessage:
        sign = draws.choice((1.0, -1.0))
        return message.with_part(where, tuple(sign * x for x in message.part(where)))
    return edit


def text(index: int, value: str) -> Edit:
    """Replace a text, a frame's name."""
    def edit(message: StampedMessage, _draws: random.Random) -> StampedMessage:
        texts = (*message.texts[:index], value, *message.texts[index + 1:])
        return replace(message, texts=texts)
    return edit


def shifted(seconds: float) -> Edit:
    """Move the stamp [s]."""
    def edit(message: StampedMessage, _draws: random.Random) -> StampedMessage:
        total = message.seconds * NANOSECONDS + message.nanoseconds + round(
            seconds * NANOSECONDS)
        whole, rest = divmod(total, NANOSECONDS)
        return replace(message, seconds=whole, nanoseconds=rest)
    return edit


def stamped(seconds: int, nanoseconds: int) -> Edit:
    """Replace the stamp, also by one that no clock shows."""
    def edit(message: StampedMessage, _draws: random.Random) -> StampedMessage:
        return replace(message, seconds=seconds, nanoseconds=nanoseconds)
    return edit


def random_bytes(data: bytes, draws: random.Random) -> bytes:
    """Return noise of any length up to the message's behind a valid encapsulation header."""
    return data[:4] + draws.randbytes(draws.randrange(len(data) - 3))


def truncated(data: bytes, draws: random.Random) -> bytes:
    """Return the beginning of a message."""
    return data[:draws.randrange(len(data))]


def huge_length(data: bytes, draws: random.Random) -> bytes:
    """Return a message whose first text claims to be longer than everything."""
    length = struct.pack('<I', draws.choice((2**32 - 1, 2**31, 2**24, len(data) + 1)))
    return data[:12] + length + data[16:]


def flipped(data: bytes, draws: random.Random) -> bytes:
    """Return a message with one to eight bits flipped, anywhere."""
    damaged = bytearray(data)
    for _ in range(draws.randint(1, 8)):
        damaged[draws.randrange(len(damaged))] ^= 1 << draws.randrange(8)
    return bytes(damaged)


def header_flipped(data: bytes, draws: random.Random) -> bytes:
    """Return a message with a random encapsulation header: another order or representation."""
    return draws.randbytes(4) + data[4:]
