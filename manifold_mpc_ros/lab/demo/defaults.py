# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the verbs that close a loop take for a run and for rest, on a spacecraft of any size."""

from __future__ import annotations

import argparse
import math

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.tune.rule import settled_rate_rad_s

# Defaults for small spacecraft: time of a run, and in horizons for others; a rate that is rest.
DURATION_S, HORIZONS = 40.0, 2.0
LARGEST_REST_RAD_S = 1e-3


def set_defaults(arguments: argparse.Namespace, config: AttitudeMpcConfig) -> None:
    """Give the arguments that go by the spacecraft the values that they have by default."""
    if arguments.rate_tolerance is None:
        arguments.rate_tolerance = min(LARGEST_REST_RAD_S, settled_rate_rad_s(
            config, math.radians(arguments.attitude_tolerance)))
    if arguments.duration is None:
        longest_s = max(DURATION_S, HORIZONS * config.steps.in_periods * config.step_s)
        arguments.duration = math.ceil(longest_s / config.step_s * (1 - 1e-9)) * config.step_s
