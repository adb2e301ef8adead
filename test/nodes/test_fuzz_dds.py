# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bytes that are no messages, on every topic that the nodes read: they live on and say so."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import serialize_message
from watching import values_of

from manifold_mpc_ros.lab.fault_injection import disturbances
from manifold_mpc_ros.lab.recording.nodes.raw import message_class

if TYPE_CHECKING:
    from harness import Rig

GARBLES = (disturbances.random_bytes, disturbances.truncated, disturbances.huge_length,
           disturbances.flipped, disturbances.header_flipped)
ROUNDS = 60
NODES = ('attitude_controller', 'lgvi_simulator')
READ = {
    'attitude_controller': {'/odometry', '/attitude_setpoint', '/direction_setpoint', '/clock'},
    'lgvi_simulator': {'/torque_command'},
}


def garbage(kind: type, draws: random.Random) -> bytes:
    """Return bytes in the place of a message, from a valid one with texts where it has any."""
    message = kind()
    if hasattr(message, 'header'):
        message.header.frame_id = 'inertial'
    data = serialize_message(message)
    garbled = draws.choice(GARBLES)(data, draws)
    return garbled[:len(data)] or b'\0'


def topics_read(rig: Rig, node: str) -> dict[str, list[str]]:
    """Return the topics that a node reads, with their types, as far as they are known here."""
    if node not in rig.node.get_node_names():
        return {}
    return dict(rig.node.get_subscriber_names_and_types_by_node(node, '/'))


def test_garbage_on_every_topic_that_is_read(rig: Rig) -> None:
    from geometry_msgs.msg import WrenchStamped
    from std_srvs.srv import Trigger

    torques = rig.watch(WrenchStamped, 'torque_command')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    rig.start('controller', parameters={'target': 'pointing', 'use_sim_time': True})
    rig.start('simulator', parameters={'timing.publish_clock': True})
    rig.until(lambda: values_of(diagnostics, NODES[0]).get('mode') == 'NOMINAL', 'a plan')
    rig.until(lambda: all(set(topics_read(rig, node)) - {'/parameter_events'} == READ[node]
                          for node in NODES), 'what both nodes read')
    read: dict[str, type] = {}
    for node in NODES:
        for topic, (name, *_) in topics_read(rig, node).items():
            kind = message_class(name)
            assert kind is not None
            read[topic] = kind
    publishers = {topic: rig.node.create_publisher(kind, topic, 10)
                  for topic, kind in read.items()}
    rig.until(lambda: all(p.get_subscription_count() for p in publishers.values()), 'the readers')
    draws = random.Random(5)
    rounds = 0

    def send() -> None:
        nonlocal rounds
        rounds += 1
        for topic, kind in read.items():
            publishers[topic].publish(garbage(kind, draws))

    rig.until(lambda: rounds >= ROUNDS, 'all rounds', meanwhile=send)
    for publisher in publishers.values():
        rig.node.destroy_publisher(publisher)

    def value(node: str, key: str) -> str:
        return values_of(diagnostics, node).get(key, '')

    def refused(node: str) -> list[Any]:
        return [key for key in values_of(diagnostics, node)
                if key.startswith('refused.') or key == 'exceptions']

    for node in NODES:
        rig.until(lambda n=node: bool(refused(n)), f'a refusal by {node}')
    # A second clock stops the time of the simulator until it is reset; nothing else of it lasts.
    answer = rig.call(Trigger, '/lgvi_simulator/reset', Trigger.Request())
    assert answer.success, answer.message
    torques.clear()
    diagnostics.clear()
    rig.until(lambda: bool(torques), 'a command after it all')
    for node in NODES:
        rig.until(lambda n=node: bool(value(n, 'mode')), f'a word from {node}')
