# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Small bags written without ROS, with every kind of message that a run has."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros.lab.recording.bags.contents import (
    DESCRIPTION_TOPIC,
    DESCRIPTION_TYPE,
    BagTopic,
    RawMessage,
    RunDescription,
)
from manifold_mpc_ros.lab.recording.bags.decode import typestore
from manifold_mpc_ros.lab.recording.bags.writer import BagWriter

STORAGES = ('mcap', 'sqlite3')
SCENARIO = '{description: synthetic, duration_s: 2.0}'
START_NS = 1_800_000_000_000_000_000
STEP_NS = 500_000_000
ENDLESS = {'sec': 9223372036, 'nsec': 854775807}
QOS = {
    'history': 'keep_last', 'depth': 10, 'reliability': 'reliable', 'durability': 'volatile',
    'deadline': ENDLESS, 'lifespan': ENDLESS, 'liveliness': 'automatic',
    'liveliness_lease_duration': ENDLESS, 'avoid_ros_namespace_conventions': False}
KINDS = {
    '/odometry': 'nav_msgs/msg/Odometry', '/imu': 'sensor_msgs/msg/Imu',
    '/pose': 'geometry_msgs/msg/PoseStamped', '/twist': 'geometry_msgs/msg/TwistStamped',
    '/torque_command': 'geometry_msgs/msg/WrenchStamped',
    '/attitude_setpoint': 'geometry_msgs/msg/QuaternionStamped',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}


def make(kind: str, **values: Any) -> Any:
    """Return a message; what is not given is zero or empty."""
    package, name = kind.split('/')
    full = f'{package}/msg/{name}'
    fields = typestore().get_msgdef(full).fields
    return typestore().types[full](**{
        field: values[field] if field in values else _zero(description)
        for field, description in fields})


def _zero(description: Any) -> Any:
    """Return the empty value of a field."""
    node, what = description
    if node == 1:  # a base type
        return {'string': '', 'bool': False}.get(what[0], 0)
    if node == 2:  # a message
        return make(what.replace('/msg/', '/'))
    if node == 3:  # an array
        return np.zeros(what[1])
    return []


def header(stamp_ns: int, frame: str = 'inertial') -> Any:
    seconds, rest = divmod(stamp_ns, 1_000_000_000)
    stamp = make('builtin_interfaces/Time', sec=seconds, nanosec=rest)
    return make('std_msgs/Header', stamp=stamp, frame_id=frame)


def quaternion(x: float, y: float, z: float, w: float) -> Any:
    return make('geometry_msgs/Quaternion', x=x, y=y, z=z, w=w)


def vector(values: Sequence[float]) -> Any:
    x, y, z = map(float, values)
    return make('geometry_msgs/Vector3', x=x, y=y, z=z)


def odometry(stamp_ns: int, xyzw: Sequence[float], rate: Sequence[float]) -> Any:
    return make(
        'nav_msgs/Odometry', header=header(stamp_ns), child_frame_id='base_link',
        pose=make('geometry_msgs/PoseWithCovariance',
                  pose=make('geometry_msgs/Pose', orientation=quaternion(*xyzw))),
        twist=make('geometry_msgs/TwistWithCovariance',
                   twist=make('geometry_msgs/Twist', angular=vector(rate))))


def wrench(stamp_ns: int, torque: Sequence[float]) -> Any:
    return make('geometry_msgs/WrenchStamped', header=header(stamp_ns, 'base_link'),
                wrench=make('geometry_msgs/Wrench', torque=vector(torque)))


def diagnostics(name: str, level: int, message: str, values: dict[str, str]) -> Any:
    pairs = [make('diagnostic_msgs/KeyValue', key=key, value=text)
             for key, text in values.items()]
    return make('diagnostic_msgs/DiagnosticArray', header=header(START_NS, ''), status=[make(
        'diagnostic_msgs/DiagnosticStatus', level=level, name=name, message=message,
        values=pairs)])


def raw(topic: str, received_ns: int, content: Any, late_ns: int = 100) -> RawMessage:
    """Return a message as it would have come ``late_ns`` after its publication."""
    data = typestore().serialize_cdr(content, KINDS[topic])
    return RawMessage(topic, received_ns, received_ns - late_ns, bytes(data))


def tick_messages(index: int) -> list[RawMessage]:
    """Return the messages of one tick of a made-up run about z."""
    stamp_ns = 1_000_000_000 + index * STEP_NS
    half = (np.pi - 0.1 * index) / 2.0
    at_ns = START_NS + 1000 * index
    return [
        raw('/odometry', at_ns, odometry(
            stamp_ns, (0.0, 0.0, np.sin(half), np.cos(half)), (0.0, 0.0, -0.01 * index))),
        raw('/torque_command', at_ns + 300, wrench(stamp_ns, (0.0, 0.0, -0.3 + 0.01 * index))),
        raw('/diagnostics', at_ns + 400, diagnostics(
            'attitude_controller', 0, 'solver: converged', {
                'mode': 'NOMINAL', 'ticks': str(index + 1), 'solver_status': 'converged',
                'command_source': 'mpc', 'iterations': '5', 'solve_time_us': '81.5',
                'cost': f'{40.0 - index:.6g}', 'refused.odometry.stale': '2'})),
    ]


def run_messages(ticks: int) -> list[RawMessage]:
    """Return a made-up run."""
    return [message for index in range(ticks) for message in tick_messages(index)]


def write_bag(
    path: Path, messages: Iterable[RawMessage], storage: str = 'mcap', *,
    scenario: str = SCENARIO, custom: dict[str, str] | None = None,
) -> Path:
    """Write a bag that `read_run` takes for a recording of ours."""
    with BagWriter(path, storage) as writer:
        writer.add_topic(BagTopic(DESCRIPTION_TOPIC, DESCRIPTION_TYPE))
        writer.add_text(DESCRIPTION_TOPIC, RunDescription(
            scenario_name='synthetic', scenario_text=scenario, backend='c').to_json(), START_NS)
        for message in messages:
            if message.topic not in writer.topics:
                writer.add_topic(BagTopic(message.topic, KINDS[message.topic], qos=(QOS,)))
            writer.write(message)
        writer.add_custom(custom or {'outcome': 'complete'})
    return path
