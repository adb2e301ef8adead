# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a node is and works with, as one latched message: a recording of it explains itself."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
from collections.abc import Mapping
from contextlib import suppress

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from manifold_mpc_ros.config.description import DESCRIBED, text_of
from manifold_mpc_ros.config.interfaces import DESCRIPTION
from manifold_mpc_ros.config.parameter import Value

_DISTRIBUTIONS = ('manifold_mpc_ros', 'casadi', 'numpy', 'scipy')


class Description:
    """Publishes ``~/description``, kept for whoever comes late.

    JSON with ``node``, ``versions``, ``backend`` (of the solver) and ``parameters``.
    """

    def __init__(self, node: Node) -> None:
        """Advertise it."""
        self._node = node
        self._publisher = node.create_publisher(
            String, DESCRIPTION[0], QoSProfile(
                depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))

    def publish(self, parameters: Mapping[str, Value], backend: str) -> None:
        """Say what is in force now."""
        self._publisher.publish(String(data=json.dumps({
            'node': self._node.get_fully_qualified_name(), 'versions': _versions(),
            'backend': backend, 'parameters': {
                name: text_of(str(value)) if name in DESCRIBED else value
                for name, value in parameters.items()}}, sort_keys=True)))


def _versions() -> dict[str, str]:
    """Return the versions of what is installed and in use."""
    found = {'python': platform.python_version(), 'machine': platform.machine(),
             'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
             'rmw': rclpy.get_rmw_implementation_identifier()}
    for name in _DISTRIBUTIONS:
        with suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found
