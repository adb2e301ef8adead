# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of another stack as bags of the shipped messages, by the descriptions of that stack.

States become nav_msgs/Odometry, commanded attitudes QuaternionStamped, commands WrenchStamped. The
definitions of their types are those inside the bag, or else those of an installed package.
Messages are read in the order of the bag, as a controller would have heard them; they are received
by the clock that is in the bag, where there is one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from manifold_mpc_ros.config.description import (
    DESCRIBED,
    PLAIN,
    command_description,
    setpoint_description,
    state_description,
)
from manifold_mpc_ros.control.described.command import CommandWriter
from manifold_mpc_ros.control.described.conversions import read_attitude
from manifold_mpc_ros.control.described.fields import WRONG_FIELD, value_at
from manifold_mpc_ros.control.described.source import DescribedSource, read_part
from manifold_mpc_ros.control.input_gate import NANOSECONDS, RawState, Refusal
from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags import decode
from manifold_mpc_ros.lab.recording.bags.contents import (
    BagContents,
    BagTopic,
    RawMessage,
    stamp_ns_of,
)
from manifold_mpc_ros.lab.recording.bags.definitions import types_of
from manifold_mpc_ros.lab.recording.scenarios.scenario import is_shipped_state

#: What the messages are called, and their frames, as `manifold-mpc record` has them.
CLOCK = '/clock'
STATE, SETPOINT, TORQUE = '/odometry', '/attitude_setpoint', '/torque_command'
FRAMES = ('inertial', 'base_link')


@dataclass(frozen=True)
class StackDescriptions:
    """Descriptions of what a bag has, as the controller's parameters of these names; '' for none.

    ``full_scale_torque_n_m`` is needed where commands are normalised.
    """

    state_source: str = ''
    setpoint_source: str = ''
    command_sink: str = ''
    full_scale_torque_n_m: tuple[float, ...] = (float('inf'),)

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> StackDescriptions | None:
        """Return what a controller with these parameters spoke, None for the shipped messages."""
        given = {name: str(parameters.get(name, PLAIN)) for name in DESCRIBED}
        theirs = {name: text for name, text in given.items() if not (
            is_shipped_state(text) if name == 'state_source' else text == PLAIN)}
        return cls(**theirs, full_scale_torque_n_m=tuple(
            parameters.get('full_scale_torque_n_m', ()))) if theirs else None


def translated(
    contents: BagContents, stack: StackDescriptions, warnings: list[str],
) -> BagContents:
    """Return the bag with the shipped messages; raises BagError, ConfigurationError."""
    translator = _Translator(contents, stack)
    messages = tuple(translator.messages())
    warnings += [f'{topic}: {count} messages could not be used: {reason}'
                 for (topic, reason), count in translator.unusable.items()]
    kinds = {STATE: decode.ODOMETRY, SETPOINT: decode.ATTITUDE, TORQUE: decode.WRENCH}
    return replace(contents, messages=messages, topics={
        **contents.topics, **{topic: BagTopic(topic, kind) for topic, kind in kinds.items()}})


class _Translator:
    """Reads the described topics of a bag."""

    def __init__(self, contents: BagContents, stack: StackDescriptions) -> None:
        """Find the topics and the definitions of their types."""
        self._contents = contents
        self.unusable: Counter[tuple[str, str]] = Counter()
        self._latest_ns = 0
        self._described: dict[str, tuple[str, Any]] = {}
        if stack.state_source:
            state = state_description(stack.state_source)
            self._source = DescribedSource(state)
            for part in (state.attitude, state.rate):
                self._described[self._topic(part)] = (STATE, part)
        if stack.setpoint_source:
            setpoint = setpoint_description(stack.setpoint_source)
            self._described[self._topic(setpoint)] = (SETPOINT, setpoint)
        if stack.command_sink:
            command = next(each for each in command_description(stack.command_sink)
                           if each.fields and each.quantity == 'body_torque')
            self._writer = CommandWriter(command, FRAMES[1], stack.full_scale_torque_n_m)
            self._described[self._topic(command)] = (TORQUE, command)
        self._types = types_of(contents.path, {part.message_type for _, part in
                                          self._described.values()})

    def messages(self) -> Iterator[RawMessage]:
        """Yield the messages of the bag, the described ones as shipped ones."""
        clock_ns = 0 if any(each.topic == CLOCK for each in self._contents.messages) else None
        for message in self._contents.messages:
            if message.topic == CLOCK:
                clock_ns = stamp_ns_of(message.data)
            if message.topic not in self._described:
                yield message
                continue
            target, part = self._described[message.topic]
            try:
                content = self._types.deserialize_cdr(message.data, part.message_type)
                data = self._data(target, part, content, (
                    message.received_ns if clock_ns is None else clock_ns))
            except (*decode.DAMAGE, *WRONG_FIELD) as error:
                self.unusable[message.topic, ' '.join(str(error).split())[:120]] += 1
            else:
                if data is not None:
                    yield replace(message, topic=target, data=data)

    def _data(self, target: str, part: Any, content: Any, received_ns: int) -> bytes | None:
        """Return the shipped message of a described one; None before a state or time begins."""
        if target == STATE:
            read = self._source.read(part.topic, content, received_ns)
            if isinstance(read, Refusal):
                raise ValueError(read.detail)
            return None if read is None or not read.stamp_ns else self._state(read)
        if target == SETPOINT:
            setpoint = read_part(part, content, received_ns)
            return decode.attitude_cdr(
                received_ns if part.stamp_unit_ns else setpoint.stamp_ns,
                read_attitude(part.convention, setpoint.values), FRAMES[0])
        torque, stamp_ns = self._writer.read(content), self._latest_ns or received_ns
        if part.stamp and not part.stamp_unit_ns:
            time = value_at(content, part.stamp)
            stamp_ns = time.sec * NANOSECONDS + time.nanosec
        return decode.torque_cdr(stamp_ns, torque, FRAMES[1])

    def _state(self, state: RawState) -> bytes:
        """Return a state, whose stamp later commands answer that have none of their own."""
        if not (state.has_attitude and state.has_rate):
            raise ValueError('it says that it has no attitude or no rate')
        self._latest_ns = state.stamp_ns
        return decode.odometry_cdr(
            state.stamp_ns, state.quaternion_xyzw, state.omega_BN_B, FRAMES)

    def _topic(self, part: Any) -> str:
        """Return the topic of a bag that a description means, whatever its namespace."""
        absolute = part.topic.startswith('/')
        found = [name for name, topic in self._contents.topics.items()
                 if topic.kind == part.message_type and (
                     name == part.topic if absolute else name.endswith(f'/{part.topic}'))]
        if len(found) != 1:
            topics = ', '.join(found or [f'{topic.name} ({topic.kind})' for topic in
                                         self._contents.topics.values()])
            raise BagError(f'{self._contents.path}: {len(found)} topics, not one, are '
                           f'{part.topic} ({part.message_type}): {topics}')
        return found[0]
