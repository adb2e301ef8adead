# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The executable ``guidance``: the node attitude_guidance in a process of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from manifold_mpc_ros.config.guidance import GUIDANCE_NAME, GUIDANCE_PARAMETERS
from manifold_mpc_ros.nodes.process import run
from manifold_mpc_ros.nodes.usage import Program

PROGRAM = Program.managed(
    'guidance',
    GUIDANCE_NAME,
    'Command attitudes that move: nadir, velocity, Sun, a target on the ground, spin.',
    GUIDANCE_PARAMETERS,
    publishes=(
        ('reference', 'trajectory_msgs/msg/MultiDOFJointTrajectory', 'commanded attitudes'),
        ('sun_direction', 'geometry_msgs/msg/Vector3Stamped', 'unit vector to the Sun'),
    ),
    diagnostics='mode, rate, elevation',
    reset='publish at once',
    pause='true: publish nothing',
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node; return the exit status."""
    return run(PROGRAM, 'manifold_mpc_ros.nodes.guidance.node:AttitudeGuidanceNode', argv)


if __name__ == '__main__':
    sys.exit(main())
