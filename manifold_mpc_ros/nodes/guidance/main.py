# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The executable ``guidance``: the node attitude_guidance in a process of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from manifold_mpc_ros.config.guidance import GUIDANCE_NAME, GUIDANCE_PARAMETERS
from manifold_mpc_ros.config.interfaces import BOND, DESCRIPTION
from manifold_mpc_ros.nodes.process import run
from manifold_mpc_ros.nodes.usage import Program

PROGRAM = Program(
    executable='guidance',
    node_name=GUIDANCE_NAME,
    summary='Command attitudes that move: nadir, velocity, Sun, a target on the ground, spin.',
    parameters=GUIDANCE_PARAMETERS,
    subscribes=(
        ('/clock', 'rosgraph_msgs/msg/Clock', 'time, with use_sim_time'),
        BOND,
    ),
    publishes=(
        ('reference', 'trajectory_msgs/msg/MultiDOFJointTrajectory', 'commanded attitudes'),
        ('sun_direction', 'geometry_msgs/msg/Vector3Stamped', 'unit vector to the Sun'),
        ('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', 'mode, rate, elevation'),
        BOND,
        DESCRIPTION,
    ),
    replies=(
        ('~/reset', 'std_srvs/srv/Trigger', 'publish at once'),
        ('~/pause', 'std_srvs/srv/SetBool', 'true: publish nothing'),
    ),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node; return the exit status."""
    return run(PROGRAM, 'manifold_mpc_ros.nodes.guidance.node:AttitudeGuidanceNode', argv)


if __name__ == '__main__':
    sys.exit(main())
