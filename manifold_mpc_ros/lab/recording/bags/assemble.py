# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a bag's messages to the arrays of a run."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.tables import CONTROLLER_NAME
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.control.moving.trajectory import Trajectory
from manifold_mpc_ros.lab.recording.bags import decode
from manifold_mpc_ros.lab.recording.bags.contents import BagContents
from manifold_mpc_ros.lab.recording.bags.decode import Stamped, StateValue
from manifold_mpc_ros.lab.recording.bags.series import (
    DEVICE_QUANTITIES,
    CommandSeries,
    PredictionSeries,
    ReferenceSeries,
    SetpointSeries,
    StateSeries,
    TickSeries,
)
from manifold_mpc_ros.lab.recording.bags.targets import read_trajectory
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario
from manifold_mpc_ros.lie.arrays import Array, IntArray
from manifold_mpc_ros.mpc.target import attitude_towards

Decoded = TypeVar('Decoded')
#: Time of receipt [ns], attitude and rate of one stamp; what has not come is None.
_Joined = tuple[int, Array | None, Array | None]
_NUMBER = re.compile(r'-?\d[-+.\de]*')


@functools.cache
def shipped_scenario() -> Scenario:
    """Return the scenario that changes nothing of the shipped parameters."""
    return Scenario.from_text('{description: as shipped, duration_s: 30.0}', 'shipped')


class Source:
    """A bag as a source of series; what is wrong is added to ``warnings``, the rest to ``notes``.

    Messages of a topic that cannot be used for the same reason are one line with their number.
    """

    def __init__(self, contents: BagContents, warnings: list[str], notes: list[str]) -> None:
        """Keep them."""
        self._contents, self._warnings, self._notes = contents, warnings, notes

    def states(self, state: str, pose: str, twist: str) -> StateSeries:
        """Return the states of one topic, or of a pose joined with a twist by equal stamps."""
        joined: dict[int, _Joined] = {}
        repeats = 0
        for topic in filter(None, (state,) if state else (pose, twist)):
            samples = self._samples(topic)
            repeats += self._join(topic, samples, joined)
        whole = {stamp: entry for stamp, entry in sorted(joined.items())
                 if entry[1] is not None and entry[2] is not None}
        self._warnings += _lacking(state or f'{pose} with {twist}', joined,
                                   reported=self._kind(state) == decode.IMU)
        stamps = _integers(list(whole))
        return StateSeries(
            stamps, _seconds(stamps, int(stamps[0]) if len(stamps) else 0),
            _integers([entry[0] for entry in whole.values()]),
            np.array([entry[1] for entry in whole.values()]).reshape(-1, 3, 3),
            np.array([entry[2] for entry in whole.values()]).reshape(-1, 3), repeats)

    def _join(
        self, topic: str, samples: Sequence[Stamped[StateValue]], joined: dict[int, _Joined],
    ) -> int:
        """Add the states of a topic to those of equal stamps; return how many were repeats."""
        seen: set[int] = set()
        previous_ns = again = 0
        for sample in samples:
            at_once, previous_ns = sample.stamp_ns == previous_ns, sample.stamp_ns
            if sample.stamp_ns in seen:
                again += not at_once  # at once: lockstep asks again
                continue
            seen.add(sample.stamp_ns)
            received_ns, R_NB, omega = joined.get(
                sample.stamp_ns, (sample.received_ns, None, None))
            value = sample.value
            joined[sample.stamp_ns] = (
                max(received_ns, sample.received_ns),
                value.R_NB if value.R_NB is not None else R_NB,
                value.omega_BN_B if value.omega_BN_B is not None else omega)
        if again:
            self._notes.append(
                f'{topic}: {again} of {len(samples)} states have stamps that came before (a '
                'recording of something played in a loop?); they are left out')
        return len(samples) - len(seen)

    def commands(self, topic: str, first_ns: int, *, once: bool) -> CommandSeries:
        """Return the torques; with ``once`` a stamp that comes again is a repeat, left out."""
        samples = self._decoded(topic, {decode.WRENCH: _torque})
        kept: list[Stamped[Array]] = []
        seen: set[int] = set()
        for sample in samples:
            if not (once and sample.stamp_ns in seen):
                kept.append(sample)
                seen.add(sample.stamp_ns)
        stamps = _integers([sample.stamp_ns for sample in kept])
        return CommandSeries(
            stamps, _seconds(stamps, first_ns), _received(kept),
            np.array([sample.value for sample in kept]).reshape(-1, 3),
            len(samples) - len(kept))

    def setpoints(
        self, attitude: str, direction: str, first_ns: int, config: AttitudeMpcConfig,
    ) -> SetpointSeries:
        """Return what was commanded; one without a stamp counts from the first state."""
        samples = self._decoded(attitude, {decode.ATTITUDE: lambda content: (
            decode.rotation(content.quaternion), np.full(3, np.nan))})
        samples += self._decoded(direction, {decode.DIRECTION: lambda content: (
            attitude_towards(config, _direction(content)), _direction(content))})
        samples.sort(key=lambda sample: (sample.stamp_ns, sample.received_ns))
        stamps = _integers([sample.stamp_ns or first_ns for sample in samples])
        return SetpointSeries(
            stamps, _seconds(stamps, first_ns), _received(samples),
            np.array([sample.value[0] for sample in samples]).reshape(-1, 3, 3),
            np.array([sample.value[1] for sample in samples]).reshape(-1, 3))

    def references(self, trajectories: str, setpoints: str, first_ns: int,
                   read_setpoint: Callable[[Any], Trajectory]) -> ReferenceSeries:
        """Return what was commanded that moves, each stamp once."""
        samples = self._decoded(trajectories, {decode.TRAJECTORY: read_trajectory})
        samples += self._decoded(setpoints, {decode.ODOMETRY: read_setpoint})
        once = {sample.stamp_ns: sample for sample in reversed(samples)}
        kept = sorted(once.values(), key=lambda sample: sample.stamp_ns)
        stamps = _integers([sample.stamp_ns for sample in kept])
        return ReferenceSeries(stamps, _seconds(stamps, first_ns), _received(kept),
                               tuple(sample.value for sample in kept))

    def directions(self, topic: str) -> tuple[IntArray, Array]:
        """Return stamps (k,) and unit directions (k, 3) in the order of their stamps."""
        samples = self._decoded(topic, {decode.DIRECTION: _direction})
        samples.sort(key=lambda sample: (sample.stamp_ns, sample.received_ns))
        return (_integers([sample.stamp_ns for sample in samples]),
                np.array([sample.value for sample in samples]).reshape(-1, 3))

    def predictions(self, topic: str) -> PredictionSeries:
        """Return the plans."""
        samples = self._decoded(topic, {decode.PATH: decode.path})
        return PredictionSeries(
            _integers([sample.stamp_ns for sample in samples]), _received(samples),
            tuple(sample.value for sample in samples))

    def ticks(self, topic: str, limit: int | None) -> TickSeries:
        """Return what the controller said about each tick, up to ``limit`` of them."""
        by_tick: dict[int, tuple[int, int, str, Mapping[str, str]]] = {}
        last: Mapping[str, str] = {}
        for sample in self._decoded(topic, {decode.DIAGNOSTICS: _controller_status}):
            if sample.value is None:
                continue
            level, message, values = sample.value
            tick = values.get('ticks', '')
            if limit is not None and tick.isdecimal() and int(tick) > limit:
                continue
            last = values
            if tick.isdecimal() and int(tick) > 0:
                by_tick.setdefault(int(tick), (sample.received_ns, level, message, values))
        ordered = [by_tick[tick] for tick in sorted(by_tick)]
        said = [entry[3] for entry in ordered]

        def words(key: str) -> tuple[str, ...]:
            return tuple(values.get(key, '') for values in said)

        def numbers(key: str) -> Array:
            return np.array([_number(values.get(key, '')) for values in said])

        return TickSeries(
            tick=_integers(sorted(by_tick)),
            received_ns=_integers([entry[0] for entry in ordered]),
            level=_integers([entry[1] for entry in ordered]),
            message=tuple(entry[2] for entry in ordered), mode=words('mode'),
            source=words('command_source'), solver_status=words('solver_status'),
            promise=words('promise'), iterations=numbers('iterations'),
            solve_time_s=numbers('solve_time_us') * 1e-6, cost=numbers('cost'),
            value_function=numbers('value_function'), promised_value=numbers('promised_value'),
            relative_excess=numbers('relative_excess'),
            in_terminal_set=words('in_terminal_set'), last=last, devices=_devices(last, numbers))

    def _samples(self, topic: str) -> list[Stamped[StateValue]]:
        """Return the states of a topic, whatever its type."""
        return self._decoded(topic, decode.STATE_READERS, stamped=True)

    def _kind(self, topic: str) -> str:
        """Return the type of a topic, empty without one."""
        return self._contents.topics[topic].kind if topic in self._contents.topics else ''

    def _decoded(
        self, topic: str, readers: Mapping[str, Callable[[Any], Decoded]], *,
        stamped: bool = False,
    ) -> list[Stamped[Decoded]]:
        """Return the messages of a topic as one of the types in ``readers``."""
        known = self._contents.topics.get(topic)
        if known is None:
            return []
        if known.kind not in readers:
            self._warnings.append(f'{topic}: has {known.type_in_words}, expected '
                                  + ' or '.join(readers))
            return []
        messages = self._contents.of(topic)
        reasons: list[str] = []
        found = list(decode.decode(
            messages, known.kind, readers[known.kind], reasons.append, stamped=stamped))
        self._warnings += [f'{topic}: {line}' for line in _counted(reasons, len(messages))]
        return found


def _counted(reasons: Sequence[str], total: int) -> list[str]:
    """Return each reason with how many messages it holds for; numbers in it make no other one."""
    groups: dict[str, list[str]] = {}
    for reason in reasons:
        groups.setdefault(_NUMBER.sub('', reason), []).append(reason)
    return [f'{len(group)} of {total}: {group[0]}' + (
        ' (the first of them)' if len(set(group)) > 1 else '') for group in groups.values()]


def _lacking(name: str, joined: Mapping[int, _Joined], *, reported: bool) -> list[str]:
    """Return how many stamps lack the attitude or the rate; ``reported``: an IMU says so."""
    found = []
    for part, words, field in ((1, 'attitude', 'orientation'), (2, 'rate', 'angular_velocity')):
        has = {stamp: entry[part] is not None for stamp, entry in sorted(joined.items())}
        without = _integers([stamp for stamp, there in has.items() if not there])
        others = _integers([stamp for stamp, there in has.items() if there])
        if not len(without):
            continue
        why = f' ({field}_covariance[0] is -1)' if reported else ''
        if len(others):
            at = np.searchsorted(others, without).clip(1, len(others) - 1)
            gap_ns = np.minimum(np.abs(others[at - 1] - without), np.abs(others[at] - without))
            why = f'; one that has it is {gap_ns.min() / NANOSECONDS:g} s away or more'
        found.append(f'{name}: {len(without)} of {len(joined)}: no {words}{why}')
    return found


def _torque(content: Any) -> Array:
    """Return the torque of a wrench."""
    return decode.vector(content.wrench.torque)


def _direction(content: Any) -> Array:
    """Return a direction as a unit vector; raises ValueError for none."""
    direction = decode.vector(content.vector)
    size = float(np.linalg.norm(direction))
    if not 0.0 < size < math.inf:
        raise ValueError(f'{direction.tolist()} is not a direction')
    return direction / size


def _controller_status(content: Any) -> tuple[int, str, dict[str, str]] | None:
    """Return level, message and values of the controller's status, None for another's."""
    for status in content.status:
        if status.name.rpartition('/')[2] == CONTROLLER_NAME:
            return (int(status.level), str(status.message),
                    {str(pair.key): str(pair.value) for pair in status.values})
    return None


def _devices(last: Mapping[str, str], numbers: Callable[[str], Array]
             ) -> dict[str, dict[str, Array]]:
    """Return what ticks say of devices: quantity to name to values (t,)."""
    found = {quantity: {
        key.removesuffix(end) or key: numbers(key) for key in last if key.endswith(end)}
             for end, quantity in DEVICE_QUANTITIES.items()}
    return {quantity: values for quantity, values in found.items() if values}


def _number(text: str) -> float:
    """Return the number that a text begins with, NaN for none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _received(samples: Sequence[Stamped[Any]]) -> IntArray:
    """Return the times of receipt."""
    return _integers([sample.received_ns for sample in samples])


def _integers(values: Sequence[int]) -> IntArray:
    """Return integers as an array."""
    return np.array(values, dtype=np.int64).reshape(-1)


def _seconds(stamps: IntArray, first_ns: int) -> Array:
    """Return stamps as seconds since the first state."""
    return np.asarray((stamps - first_ns) / NANOSECONDS, dtype=np.float64)
