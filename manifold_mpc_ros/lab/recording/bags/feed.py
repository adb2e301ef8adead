# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a live controller is given when a bag is replayed: serialized states and setpoints.

Of a recording of ours every message is given byte by byte as it was. Of a bag from another stack
states become odometry, and setpoints get this controller's frames: their attitude has to map body
components to inertial ones, and their rate has to be in body axes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.interfaces import MAGNETIC_FIELD, WHEEL_STATES
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags import decode
from manifold_mpc_ros.lab.recording.bags.assemble import Source
from manifold_mpc_ros.lab.recording.bags.contents import RawMessage, stamp_ns_of
from manifold_mpc_ros.lab.recording.bags.run import BagRun
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

STATE_TOPICS = {decode.ODOMETRY: '/odometry', decode.IMU: '/imu'}
ATTITUDE_TOPIC, DIRECTION_TOPIC = '/attitude_setpoint', '/direction_setpoint'
#: What brings targets that move, by topic: the type.
MOVING = {'/reference': decode.TRAJECTORY, '/odometry_setpoint': decode.ODOMETRY}
#: What devices report, by topic: the type.
REPORTS = {f'/{topic}': kind for topic, kind, _ in (WHEEL_STATES, MAGNETIC_FIELD)}


@dataclass(frozen=True)
class FeedMessage:
    """One message for the controller: where to, its stamp, when it is due, its bytes.

    ``due_ns`` is time as the stamps have it; a message that came late in the recording is due
    later than its stamp says.
    """

    topic: str
    stamp_ns: int
    due_ns: int
    data: bytes


@dataclass(frozen=True)
class Feed:
    """States (of one type) and setpoints, each in the order of their stamps.

    Directions of cones are among the setpoints; ``reports`` are the speeds of reaction wheels and
    the magnetic field, as the controller uses them, one of each at the stamp of each state.
    """

    state_kind: str
    states: tuple[FeedMessage, ...]
    setpoints: tuple[FeedMessage, ...]
    reports: tuple[FeedMessage, ...] = ()

    @property
    def state_source(self) -> str:
        """The controller's parameter ``state_source``."""
        return STATE_TOPICS[self.state_kind].lstrip('/')

    def at(self, stamps_ns: Iterable[int]) -> Feed:
        """Return the feed with no other states than those of these stamps."""
        wanted = set(stamps_ns)
        return replace(self, states=tuple(
            state for state in self.states if state.stamp_ns in wanted))

    def every(self, period_s: float) -> Feed:
        """Return the feed with states at least so far apart (less a hundredth) [s]."""
        period_ns, states = round(0.99 * period_s * NANOSECONDS), list(self.states[:1])
        for state in self.states:
            if state.stamp_ns - states[-1].stamp_ns >= period_ns:
                states.append(state)
        return replace(self, states=tuple(states))


def feed_of(run: BagRun, config: ControllerConfig) -> Feed:
    """Return what the bag has for a controller.

    Raises BagError when no state can be given to a controller.
    """
    names = run.topics
    source = names.received_state or names.state
    kind = run.contents.topics[source].kind if source in run.contents.topics else ''
    if run.scenario is not None and kind in STATE_TOPICS:
        states = _as_recorded(run, source, STATE_TOPICS[kind], run.received_states.stamp_ns)
        setpoints = [message for topic, target in (
            (names.attitude_setpoint, ATTITUDE_TOPIC), (names.direction_setpoint, DIRECTION_TOPIC))
            for message in _as_recorded(run, topic, target, run.setpoints.stamp_ns)]
    else:
        kind = decode.ODOMETRY
        states, setpoints = _states(run, config), _setpoints(run, config)
    if run.scenario is not None or run.description.controller_parameters:  # frames as they were
        for topic, target in zip((names.reference, names.odometry_setpoint), MOVING, strict=True):
            setpoints += _as_recorded(run, topic, target, run.references.stamp_ns)
    for topic in dict.fromkeys(topic for topic, _ in config.cone_topics.values()):
        full = topic if topic.startswith('/') else f'/{topic}'
        stamps = Source(run.contents, [], []).directions(full)[0]
        setpoints += _as_recorded(run, full, full, stamps)
    if not states:
        raise BagError(f'{run.path}: no state on {source} has a stamp and finite values')
    used = (config.mpc.wheels is not None, config.magnetorquers is not None)
    reports = [report for topic, use in zip(REPORTS, used) if use for report in _as_recorded(
        run, topic, topic, [each.stamp_ns for each in states])]
    return Feed(kind, _ordered(states), _ordered(setpoints), _ordered(reports))


def _as_recorded(
    run: BagRun, topic: str, target: str, stamps_ns: Sequence[int] | np.ndarray,
) -> list[FeedMessage]:
    """Return the readable messages of a topic, each stamp once."""
    readable = set(map(int, stamps_ns))
    found: dict[int, FeedMessage] = {}
    for message in run.contents.of(topic):
        stamp_ns = _stamp(message)
        if stamp_ns in readable and stamp_ns > 0:
            found.setdefault(stamp_ns, FeedMessage(
                target, stamp_ns, _due_ns(run, stamp_ns, message.received_ns), message.data))
    return list(found.values())


def _due_ns(run: BagRun, stamp_ns: int, received_ns: int) -> int:
    """Return the simulated time at which a message was received; in lockstep, its stamp."""
    states = run.states
    if run.scenario is None or run.lockstep:
        return stamp_ns
    origin_ns, first_ns = int(states.received_ns[0]), int(states.stamp_ns[0])
    elapsed_ns = np.interp(received_ns - origin_ns, states.received_ns - origin_ns,
                           states.stamp_ns - first_ns)
    return max(stamp_ns, first_ns + round(float(elapsed_ns)))


def _stamp(message: RawMessage) -> int:
    """Return the stamp of a message, 0 for one that is too short to have any."""
    try:
        return stamp_ns_of(message.data)
    except (struct.error, IndexError):
        return 0


def _states(run: BagRun, config: ControllerConfig) -> list[FeedMessage]:
    """Return the states as odometry in the controller's frames."""
    states = run.received_states
    rows = zip(map(int, states.stamp_ns), states.R_NB, states.omega_BN_B, strict=True)
    return [
        FeedMessage(STATE_TOPICS[decode.ODOMETRY], stamp_ns, stamp_ns,
                    decode.odometry_cdr(stamp_ns, _xyzw(R_NB), omega, (
                        config.inertial_frame_id, config.body_frame_id)))
        for stamp_ns, R_NB, omega in rows
        if stamp_ns > 0 and np.isfinite(omega).all()]


def _setpoints(run: BagRun, config: ControllerConfig) -> list[FeedMessage]:
    """Return the commanded attitudes, directions included as the attitude made of them."""
    setpoints = run.setpoints
    rows = zip(map(int, setpoints.stamp_ns), setpoints.R_ND, strict=True)
    return [FeedMessage(ATTITUDE_TOPIC, stamp_ns, stamp_ns, decode.attitude_cdr(
        stamp_ns, _xyzw(R_ND), config.inertial_frame_id)) for stamp_ns, R_ND in rows]


def _xyzw(R: Array) -> tuple[float, float, float, float]:
    """Return a rotation as a quaternion x, y, z, w."""
    w, x, y, z = map(float, so3.quaternion_from_rotation(R))
    return (x, y, z, w)


def _ordered(messages: list[FeedMessage]) -> tuple[FeedMessage, ...]:
    """Return messages in the order of their stamps."""
    return tuple(sorted(messages, key=lambda message: message.stamp_ns))
