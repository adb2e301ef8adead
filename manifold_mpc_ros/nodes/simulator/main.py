# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The executable ``simulator``: the node lgvi_simulator in a process of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from manifold_mpc_ros.config.interfaces import (
    MAGNETIC_FIELD,
    WHEEL_STATES,
    command_topics,
    state_topics,
)
from manifold_mpc_ros.config.tables import SIMULATOR_NAME, SIMULATOR_PARAMETERS
from manifold_mpc_ros.nodes.process import run
from manifold_mpc_ros.nodes.usage import Program

PROGRAM = Program.managed(
    'simulator',
    SIMULATOR_NAME,
    'Simulate a rigid spacecraft under torque commands, by a variational integrator on '
    'SO(3).',
    SIMULATOR_PARAMETERS,
    subscribes=(
        *command_topics(),
        *command_topics('wheels'),
        *command_topics('thrusters'),
        *command_topics('magnetorquers'),
    ),
    publishes=(
        *state_topics(),
        WHEEL_STATES,
        MAGNETIC_FIELD,
        ('/clock', 'rosgraph_msgs/msg/Clock', 'simulated time, with publish_clock'),
    ),
    diagnostics='time, plant, refusals',
    reset='back to the initial attitude and rate',
    pause='true: stop simulated time',
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the simulator; return the exit status."""
    return run(PROGRAM, 'manifold_mpc_ros.nodes.simulator.node:LgviSimulatorNode', argv)


if __name__ == '__main__':
    sys.exit(main())
