# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The executable ``markers``: the node attitude_markers in a process of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from manifold_mpc_ros.config.interfaces import (
    BOND,
    DESCRIPTION,
    command_topics,
    setpoint_topics,
    state_topics,
)
from manifold_mpc_ros.config.tables import MARKERS_NAME, MARKERS_PARAMETERS
from manifold_mpc_ros.nodes.process import run
from manifold_mpc_ros.nodes.usage import Program

PROGRAM = Program(
    executable='markers',
    node_name=MARKERS_NAME,
    summary='Draw the closed loop for RViz and Foxglove: body, axes, setpoint, prediction, '
            'torque.',
    parameters=MARKERS_PARAMETERS,
    subscribes=(
        *state_topics(),
        *setpoint_topics(),
        ('direction_setpoint', 'geometry_msgs/msg/Vector3Stamped', 'commanded direction'),
        *command_topics(),
        ('attitude_controller/prediction', 'nav_msgs/msg/Path', 'predicted attitudes'),
        ('/clock', 'rosgraph_msgs/msg/Clock', 'time, with use_sim_time'),
        BOND,
    ),
    publishes=(
        ('~/markers', 'visualization_msgs/msg/MarkerArray', 'only while somebody reads'),
        ('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', 'pictures drawn, refusals'),
        BOND,
        DESCRIPTION,
    ),
    replies=(
        ('~/reset', 'std_srvs/srv/Trigger', 'forget what was seen'),
        ('~/pause', 'std_srvs/srv/SetBool', 'true: hold the picture'),
    ),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node; return the exit status."""
    return run(PROGRAM, 'manifold_mpc_ros.nodes.markers.node:AttitudeMarkersNode', argv)


if __name__ == '__main__':
    sys.exit(main())
