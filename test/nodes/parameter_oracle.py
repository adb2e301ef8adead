# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A bare rclpy node as the judge of parameter files: reads paths from stdin, writes JSON lines.

For each file the parameters that a node of the given full name gets from ``--params-file``, as
[name, repr of the value] in order, or None where ROS refuses the file. Run as a process of its
own: a process has one RMW and one log folder.
"""

from __future__ import annotations

import json
import os
import sys

import rclpy
from rclpy.context import Context
from rclpy.node import Node


def overrides(path: str, namespace: str, name: str) -> list[tuple[str, str]] | None:
    """Return what a node is given by one parameter file."""
    context = Context()
    try:
        rclpy.init(args=['--ros-args', '--params-file', path], context=context)
    except RuntimeError:
        return None
    try:
        node = Node(name, namespace=namespace, context=context, enable_rosout=False,
                    start_parameter_services=False)
        try:
            return [(key, repr(each.value)) for key, each in node._parameter_overrides.items()]
        finally:
            node.destroy_node()
    finally:
        context.try_shutdown()


def main() -> None:
    """Answer every line of stdin with a line."""
    namespace, name = sys.argv[1].rpartition('/')[::2]
    for line in sys.stdin:
        answer = overrides(line.rstrip('\n'), namespace, name)
        sys.stdout.write(json.dumps(answer) + '\n')
        sys.stdout.flush()


if __name__ == '__main__':
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    main()
