# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide about a pass."""

from __future__ import annotations

# Fraction of the way to a bound that one step may go.
BOUNDARY = 0.995
# Stop when stationarity and complementarity are below this (dimensionless).
TOLERANCE = 1e-8
# Stationarity is relative to the largest torque gradient where that exceeds this: with short steps
# it is large, and so is its rounding.
LARGE_FORCE = 10.0
# The barrier ends here; the cost is then within 24 N times this of the optimum.
SMALLEST_BARRIER = 1e-9
# Shrink the barrier once the model expects less decrease than this many times mu.
BARRIER_READY = 300.0
BARRIER_FACTOR = 0.1
# ... after a step of at least this length.
READY_LENGTH = 0.9
ARMIJO = 1e-4
# Rounding of cost and barrier, relative: changes below it count as no increase.
COST_NOISE = 1e-11
BARRIER_NOISE = 1e-13
BACKTRACK = 1 / 3
SMALLEST_STEP = 1e-6
# Blend towards the exact Hessian: halved while it is indefinite and after a step shorter than this
# (an almost singular Hessian sends the plan far away, and the search creeps), grown by any other.
SHORT_LENGTH = 0.03
BLEND_DOWN = 0.5
BLEND_UP = 1.5
SMALLEST_BLEND = 0.05
# A relative pivot of the control's Hessian below this counts as indefinite.
SMALLEST_PIVOT = 1e-14

# KKT residual at which a start that can make no more progress counts as converged.
ACCEPTABLE_RESIDUAL = 1e-6
# Barrier parameter and most passes of a warm start, the next where one does not converge. The
# first ends after one pass that expects the cost to fall by more than this part of it: so near to
# the limits, a long way takes many short steps.
FAR_DECREASE = 0.03
WARM_STARTS = ((1e-6, 30), (1e-3, 50), (1e-1, 200))

RUNNING, CONVERGED, STALLED, OUT_OF_TIME = range(4)


def constants() -> dict[str, float]:
    """Return the numbers by name, for the C driver."""
    names = [name for name, value in globals().items()
             if name.isupper() and isinstance(value, float)]
    return {name: globals()[name] for name in names}


def warm_starts() -> str:
    """Return WARM_STARTS as the rows of a C array."""
    return ', '.join(f'{{{mu!r}, {most}}}' for mu, most in WARM_STARTS)
