# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The executable ``simulator``: the node lgvi_simulator in a process of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from manifold_mpc_ros.config.interfaces import (
    BOND,
    DESCRIPTION,
    WHEEL_STATES,
    command_topics,
    state_topics,
)
from manifold_mpc_ros.config.tables import SIMULATOR_NAME, SIMULATOR_PARAMETERS
from manifold_mpc_ros.nodes.process import run
from manifold_mpc_ros.nodes.usage import Program

PROGRAM = Program(
    executable='simulator',
    node_name=SIMULATOR_NAME,
    summary='Simulate a rigid spacecraft under torque commands, by a variational integrator on '
            'SO(3).',
    parameters=SIMULATOR_PARAMETERS,
    subscribes=(
        *command_topics(),
        *command_topics('wheels'),
        ('/clock', 'rosgraph_msgs/msg/Clock', 'time, with use_sim_time'),
        BOND,
    ),
    publishes=(
        *state_topics(),
        WHEEL_STATES,
        ('/clock', 'rosgraph_msgs/msg/Clock', 'simulated time, with publish_clock'),
        ('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', 'time, plant, refusals'),
        BOND,
        DESCRIPTION,
    ),
    replies=(
        ('~/reset', 'std_srvs/srv/Trigger', 'back to the initial attitude and rate'),
        ('~/pause', 'std_srvs/srv/SetBool', 'true: stop simulated time'),
    ),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the simulator; return the exit status."""
    return run(PROGRAM, 'manifold_mpc_ros.nodes.simulator.node:LgviSimulatorNode', argv)


if __name__ == '__main__':
    sys.exit(main())
