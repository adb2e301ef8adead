# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the generated code depends on; all numbers, and the horizon, are run-time values."""

from __future__ import annotations

from typing import NamedTuple


class Structure(NamedTuple):
    """Forcing, target, and which inequalities there are.

    ``rows`` has (name, number of values) of each inequality that the problem has, in the order of
    the table :data:`manifold_mpc_ros.mpc.stages.inequalities.KINDS`. ``moving``: costs are about a
    reference that moves over the horizon.
    """

    symmetric: bool
    pointing: bool
    rows: tuple[tuple[str, int], ...] = ()
    moving: bool = False
