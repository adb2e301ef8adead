# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the generated code depends on, and the two constants that its inequalities share."""

from __future__ import annotations

from typing import NamedTuple

# Cost of one unit of relative violation of a rate limit and of the terminal level, in units
# of tr(Qg)/3: exact penalties as long as they exceed the multipliers of the hard problem.
RATE_PENALTY = 1e4
TERMINAL_PENALTY = 1e3


class Structure(NamedTuple):
    """What the generated code depends on; all numbers, and the horizon, are run-time values."""

    symmetric: bool
    torque_box: bool
    rate_box: bool
    terminal_set: bool
    pointing: bool = False
