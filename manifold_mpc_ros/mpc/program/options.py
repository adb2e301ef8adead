# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide about a pass, about the search, and about keeping a plan."""

from __future__ import annotations

import math

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
# By this, and by its root, but in warm starts with limits that curve: by its square a full step
# leaves them.
BARRIER_FACTOR = 0.1
# ... after a step of at least this length.
READY_LENGTH = 0.9
# After so many shorter steps in succession it is raised, up to a bound: so near the limits that
# every step ends at one, a long way takes hundreds of them.
CREEP_PASSES = 20
BARRIER_RAISE, RAISED_BARRIER = 100.0, 1e-1
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
# The blend of a shifted plan with limits that curve: exact, it is indefinite at its new end.
WARM_BLEND = 0.05
# ... and of one that is far from its optimum, at most: exact, it is indefinite.
AFAR_BLEND = 0.25
# A relative pivot of the control's Hessian below this counts as indefinite.
SMALLEST_PIVOT = 1e-14

# KKT residual at which a start that can make no more progress counts as converged.
ACCEPTABLE_RESIDUAL = 1e-6
# Barrier parameter and most passes of a warm start, the next where one does not converge. The
# first is for plans that no limit holds back: their multipliers, dimensionless cost per relative
# unit, are below this, so that every slack is above 1 %. The first two end after one pass that
# expects the cost to fall by more than this part of it: so near to the limits, a long way takes
# many short steps.
FREE_MULTIPLIER = 1e-7
FAR_DECREASE = 0.03
# In warm starts the merit may rise below this barrier, while the KKT residual halves within so
# many passes (watchdog technique, Chamberlain et al., Math. Programming Study 16, 1982).
WATCHDOG_BARRIER, WATCHDOG_PASSES = 1e-4, 3
# The third ends after one pass too whose step reaches so many slacks beyond a limit.
LEAVING_REACH = 1.5
WARM_STARTS = ((SMALLEST_BARRIER, 5), (1e-6, 30), (1e-3, 50), (1e-1, 200))

RUNNING, CONVERGED, STALLED, OUT_OF_TIME = range(4)

# The search. Barrier parameter of a cold start (dimensionless, against a cost of order 10).
COLD_BARRIER = 1.0
# Passes of a start at most. Every start but the first ends after JUDGED_PASSES or more when its
# cost, less EXPECTED_FALLS times the largest decrease that the models of three passes expect and
# BARRIER_GAP times steps and mu, is above the best by this part of it. Judged so after 20 passes
# or one pass alone, some starts end on their way to the best plan; where a plan has many minima,
# for which such ways are longer, with so few falls too (benchmarks/bodies.py).
MOST_PASSES = 200
JUDGED_PASSES = 22
EXPECTED_FALLS, EXPECTED_FALLS_MANY, BARRIER_GAP = 2.0, 40.0, 12.0
HOPELESS = 1e-4
# Starts at most; those whose first costs agree to this are mirror images of each other.
MOST_STARTS, MIRRORED = 36, 1e-12
# Passes between two looks at whether a start is at a plan that keeps every limit.
LOOK_PASSES = 4
# A leaning start holds its octant for this part of the bang-bang slew, and no fewer steps; one of
# two components for longer.
LEAN_PART, LEAN_PART_OF_TWO = 0.25, 0.45
LEAN_STEPS = 5
# The long way round can win when the angle left to turn and to stop is above this [rad].
LONG_WAY_RAD = math.radians(130.0)
# A pointing turn leans above this.
POINTING_RAD = math.radians(100.0)
# Any other leans above this when its slew is all but one torque component, or its plan has many
# minima; then the long way round leans too, where it is little longer.
LEAN_RAD = math.radians(80.0)
ALONE = 0.1
MANY_STEPS = 25
LEAN_LONG_RAD = math.radians(150.0)
# A plan has many minima above so many times the angle that costs what full torque does: the turn
# is nearly time-optimal, which is when another axis gains time. On horizons of many steps less is
# enough, or a bang-bang slew of so many steps (benchmarks/bodies.py); and any plan has them on
# very long ones (benchmarks/search_tail.py).
FAR_TURN, FAR_TURN_OF_MANY = 40.0, 20.0
LONG_SLEW_STEPS, LONG_HORIZON = 15.0, 200
# Plans whose costs agree to this are equal; the rule then decides.
TIE = 1e-7

# A matrix farther than this from SO(3) is no rotation, nor a quaternion whose norm is off by more.
ROTATION_DEFECT = 1e-6
NORM_DEFECT = 1e-3
# A commanded attitude that moved by more than this [rad] forgets the warm start.
SETPOINT_MOVED_RAD = 1e-3
# The shifted plan itself: so near its limits that its cost is what it would be on them.
SHIFTED_BARRIER = 1e-12
# A relative violation of a state limit above this makes a plan infeasible.
VIOLATION = 1e-6
# The warm plan is kept while its value is at most the bound that follows from the last plan, plus
# this part of it, and always when less than this angle [rad] is left to turn: no other side can
# win there.
VALUE_SLACK = 1e-2
LEAST_VALUE = 1e-3
# ... and that many times it after a state from which the first warm starts do not converge.
JUMP_SLACK = 1.0
SEARCH_ANGLE_RAD = math.pi / 2
# ... or, where a cone holds the plan back, than this. It does with a slack below TOUCHED.
CONE_ANGLE_RAD = 0.2
TOUCHED = 1e-4
# Ways round cones: the attitudes that they are by way of, the ways that are tried
# (benchmarks/cone_problems.py), and attitudes at which a straight part of one is looked at. It may
# violate a cone by so much [rad]: the solver bends it.
VIAS, MOST_WAYS, WAY_PARTS = 200, 32, 13
BENT_RAD = 0.2
# A level that no state exceeds: the terminal set is then not there.
NO_LEVEL = 1e12


def constants() -> dict[str, float]:
    """Return the numbers by name, for the C sources."""
    return {name: value for name, value in globals().items()
            if name.isupper() and isinstance(value, (int, float))}


def warm_starts() -> str:
    """Return WARM_STARTS as the rows of a C array."""
    return ', '.join(f'{{{mu!r}, {most}}}' for mu, most in WARM_STARTS)
