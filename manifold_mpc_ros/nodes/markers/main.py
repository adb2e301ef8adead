# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The executable ``markers``: the node attitude_markers in a process of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from manifold_mpc_ros.config.interfaces import (
    command_topics,
    setpoint_topics,
    state_topics,
)
from manifold_mpc_ros.config.tables import MARKERS_NAME, MARKERS_PARAMETERS
from manifold_mpc_ros.nodes.process import run
from manifold_mpc_ros.nodes.usage import Program

PROGRAM = Program.managed(
    'markers',
    MARKERS_NAME,
    'Draw the closed loop for RViz and Foxglove: body, axes, setpoint, prediction, '
    'torque, cones.',
    MARKERS_PARAMETERS,
    subscribes=(
        *state_topics(),
        *setpoint_topics(),
        ('direction_setpoint', 'geometry_msgs/msg/Vector3Stamped', 'commanded direction'),
        *command_topics(),
        ('attitude_controller/prediction', 'nav_msgs/msg/Path', 'predicted attitudes'),
        ('attitude_controller/description', 'std_msgs/msg/String', 'cones, their topics'),
    ),
    publishes=(
        ('~/markers', 'visualization_msgs/msg/MarkerArray', 'only while somebody reads'),
    ),
    diagnostics='pictures drawn, refusals',
    reset='forget what was seen',
    pause='true: hold the picture',
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node; return the exit status."""
    return run(PROGRAM, 'manifold_mpc_ros.nodes.markers.node:AttitudeMarkersNode', argv)


if __name__ == '__main__':
    sys.exit(main())
