# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes bytes that are no requests to the request topics of a node's services, by another DDS.

rclpy can send wrong values to a service, but not wrong bytes; Eclipse Cyclone DDS lets a type of
any shape go by the name of the request's. ``python raw_requests.py DOMAIN NODE ROUNDS`` prints the
number of services that matched.
"""

from __future__ import annotations

import random
import sys
import time

import cyclone
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic

SERVICES = {
    'set_parameters': 'rcl_interfaces::srv::dds_::SetParameters_Request_',
    'set_parameters_atomically': 'rcl_interfaces::srv::dds_::SetParametersAtomically_Request_',
    'get_parameters': 'rcl_interfaces::srv::dds_::GetParameters_Request_',
    'describe_parameters': 'rcl_interfaces::srv::dds_::DescribeParameters_Request_',
    'list_parameters': 'rcl_interfaces::srv::dds_::ListParameters_Request_',
    'change_state': 'lifecycle_msgs::srv::dds_::ChangeState_Request_',
    'get_state': 'lifecycle_msgs::srv::dds_::GetState_Request_',
    'reset': 'std_srvs::srv::dds_::Trigger_Request_',
    'pause': 'std_srvs::srv::dds_::SetBool_Request_',
}
#: First word of a request, often the length of its array: none, few, or beyond all memory. What
#: lies between has the middleware itself allocate gigabytes, before any node can refuse.
HEADS = (0, 1, 2, 255, 2**31, 2**32 - 1)
PATIENCE_S = 20.0


def main(domain: int, node: str, rounds: int) -> None:
    """Find the services and write."""
    participant, draws, writers = DomainParticipant(domain), random.Random(domain), []
    for service, type_name in SERVICES.items():
        kind = make_idl_struct(
            service, type_name, {'head': uint32, 'tail': sequence[uint8]})
        topic = Topic(participant, f'rq/{node}/{service}Request', kind)
        writers.append((kind, DataWriter(participant, topic, qos=cyclone.RELIABLE)))
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s and not all(
            writer.get_matched_subscriptions() for _, writer in writers):
        time.sleep(0.05)
    for _ in range(rounds):
        for kind, writer in writers:
            head = draws.choice(HEADS)
            # A pause is not to be asked for by chance: its byte stays zero.
            head &= ~0xff if kind.__name__ == 'pause' else 2**32 - 1
            writer.write(kind(head=head, tail=list(draws.randbytes(draws.randrange(120)))))
        time.sleep(0.01)
    time.sleep(0.5)  # for what is still on its way
    print(sum(bool(writer.get_matched_subscriptions()) for _, writer in writers))


if __name__ == '__main__':
    main(int(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
