# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The executable ``controller``: the node attitude_controller in a process of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from manifold_mpc_ros.config.interfaces import (
    MAGNETIC_FIELD,
    WHEEL_STATES,
    command_topics,
    setpoint_topics,
    state_topics,
)
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, CONTROLLER_PARAMETERS
from manifold_mpc_ros.nodes.process import run
from manifold_mpc_ros.nodes.usage import Program

PROGRAM = Program.managed(
    'controller',
    CONTROLLER_NAME,
    'Rotate a spacecraft from any attitude to the commanded one, by model predictive '
    'control on SO(3).',
    CONTROLLER_PARAMETERS,
    subscribes=(
        *state_topics(),
        *setpoint_topics(),
        WHEEL_STATES,
        MAGNETIC_FIELD,
        ('direction_setpoint', 'geometry_msgs/msg/Vector3Stamped', 'commanded direction'),
        ('odometry_setpoint', 'nav_msgs/msg/Odometry', 'commanded attitude that moves on'),
        ('reference', 'trajectory_msgs/msg/MultiDOFJointTrajectory', 'commanded attitudes'),
    ),
    publishes=(
        *command_topics(),
        *command_topics('wheels'),
        *command_topics('thrusters'),
        *command_topics('magnetorquers'),
        ('~/prediction', 'nav_msgs/msg/Path', 'predicted attitudes'),
        ('~/disturbance', 'geometry_msgs/msg/WrenchStamped', 'estimated disturbance torque'),
        ('~/disturbance_std', 'geometry_msgs/msg/Vector3Stamped', 'its standard deviation'),
    ),
    diagnostics='mode, solver, refusals',
    reset='forget state, setpoint and warm start',
    pause='true: command zero torque',
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the controller; return the exit status."""
    return run(PROGRAM, 'manifold_mpc_ros.nodes.controller.node:AttitudeControllerNode', argv)


if __name__ == '__main__':
    sys.exit(main())
