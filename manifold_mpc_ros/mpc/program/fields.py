# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver's memory: every field that all problems have, with its size and where it lives.

A trajectory has nodes k = 0..N (attitude, momentum, free step) and stages k = 0..N-1 (step,
torque). The fields of an inequality are in its object (:mod:`manifold_mpc_ros.mpc.stages`).
Dimensionless throughout (:mod:`manifold_mpc_ros.mpc.scaling`).
"""

from __future__ import annotations

from manifold_mpc_ros.mpc.program.phase import Field, Memory
from manifold_mpc_ros.mpc.scaling import PARAMETERS

_PLAN, _MODEL, _GLOBAL = Memory.TRAJECTORY, Memory.MODEL, Memory.GLOBAL

# Trajectory: attitude q of R_DB, momentum J omega, quaternion of the step that omega alone would
# make (``free``), of the step that is made (``step``; the same one with the paper's forcing).
ATTITUDE = Field('attitude', 4, _PLAN)
MOMENTUM = Field('momentum', 3, _PLAN)
FREE = Field('free', 4, _PLAN)
STEP = Field('step', 4, _PLAN)
TORQUE = Field('torque', 3, _PLAN)

# Model of one pass. ``inner`` is the length of step k in periods (1 but for graded horizons) for
# k < N and 0 at N, ``later`` 1 for k > 0 and 0 at 0.
INNER, LATER = Field('inner', 1, _MODEL), Field('later', 1, _MODEL)
PULL = Field('pull', 3, _MODEL)            # torque gradient of the barrier model
FORCE = Field('force', 3, _MODEL)          # torque gradient of the Lagrangian
FORCE_SIZE = Field('force_size', 1, _MODEL)
TORQUE_WEIGHT = Field('torque_weight', 3, _MODEL)  # diagonal of the limits' Hessian
PRODUCTS = Field('products', 1, _MODEL)    # largest complementarity product of a stage
NODE_PRODUCTS = Field('node_products', 1, _MODEL)
TURN_GRADIENT, TURN_HESSIAN = Field('turn_gradient', 3, _MODEL), Field('turn_hessian', 6, _MODEL)
TURN_FORCE = Field('turn_force', 3, _MODEL)  # of the Lagrangian, where limits depend on it
MOVE_GRADIENT, MOVE_HESSIAN = Field('move_gradient', 3, _MODEL), Field('move_hessian', 6, _MODEL)
MOVE_FORCE = Field('move_force', 3, _MODEL)
AFTER = Field('after', 9, _MODEL)          # d m+ by the spatial increment of the step
BEFORE = Field('before', 9, _MODEL)        # d m- by it
WEIGHTED = Field('weighted', 9, _MODEL)    # d m- times the torque's Hessian
PASSED = Field('passed', 9, _MODEL)        # d (m+ + m-) by it
TURN_COSTATE = Field('turn_costate', 3, _MODEL)
MOMENTUM_COSTATE = Field('momentum_costate', 3, _MODEL)
CROSS = Field('cross', 9, _MODEL)          # Hessian between the torque's two arguments
CONTROL_GRADIENT = Field('control_gradient', 3, _MODEL)
CONTROL_HESSIAN = Field('control_hessian', 6, _MODEL)
STAGE_RESIDUAL = Field('stage_residual', 1, _MODEL)
GAIN = Field('gain', 21, _MODEL)           # feedforward, by theta, by the second state
CONTROL = Field('control', 3, _MODEL)      # of the linear roll-out, and its states:
TURN, MOVE = Field('turn', 3, _MODEL), Field('move', 3, _MODEL)
TORQUE_CHANGE = Field('torque_change', 3, _MODEL)
REACH = Field('reach', 1, _MODEL)
# Trial step.
MOMENTUM_AFTER = Field('momentum_after', 3, _MODEL)
MOMENTUM_BEFORE = Field('momentum_before', 3, _MODEL)
SOUND_STEP = Field('sound_step', 1, _MODEL)      # positive: on its branch, within its limits
SOUND_NODE, SOUND_STAGE = Field('sound_node', 1, _MODEL), Field('sound_stage', 1, _MODEL)
PENALTY_NODE = Field('penalty_node', 1, _MODEL)
COST_NODE, COST_STAGE = Field('cost_node', 1, _MODEL), Field('cost_stage', 1, _MODEL)
SLACKS_NODE, SLACKS_STAGE = Field('slacks_node', 1, _MODEL), Field('slacks_stage', 1, _MODEL)

# Globals.
PARAMETER = Field('parameter', PARAMETERS, _GLOBAL)
BARRIER, EXACT, LENGTH = (Field(name, 1, _GLOBAL) for name in ('barrier', 'exact', 'length'))
VALUE = Field('value', 27, _GLOBAL)        # gradient and Hessian (upper part) of V
FORM_GRADIENT = Field('form_gradient', 6, _GLOBAL)  # of xi^T P xi / 2
TURN_SUM = Field('turn_sum', 3, _GLOBAL)
MOMENTUM_SUM = Field('momentum_sum', 3, _GLOBAL)
LINEAR = Field('linear', 6, _GLOBAL)
# Stationarity, complementarity products, expected decrease, least pivot, largest force.
RESIDUALS = Field('residuals', 5, _GLOBAL)
LARGEST_REACH = Field('largest_reach', 1, _GLOBAL)
SUMS = Field('sums', 3, _GLOBAL)           # cost with penalties, logarithms, soundness
LEAN = Field('lean', 3, _MODEL)            # of a slew's first steps
START = Field('start', 7, _GLOBAL)         # measured attitude and momentum
CHAIN = Field('chain', 7, _GLOBAL)         # the same of the stage that a roll-out has reached
# What a caller measured: R_NB and R_ND row by row, the dimensionless rate; and what follows from
# it (reports.StateReport).
MEASURED = Field('measured', 21, _GLOBAL)
FORESEEN = Field('foreseen', 18, _GLOBAL)  # the last R_ND, and what was to follow it
STATE_REPORT = Field('state_report', 7, _GLOBAL)
# A body that the loop is closed with: inertia, column by column, disturbance torque and the torque
# that is applied, dimensionless.
BODY = Field('body', 12, _GLOBAL)
APPLIED = Field('applied', 3, _GLOBAL)
# Report of a plan: cost of the first stage, xi^T P xi / c at both ends; what violations add to the
# cost, the largest relative violation at a node, by how much the terminal set is missed; R_NB and
# rate of a node.
FIRST_COST = Field('first_cost', 1, _GLOBAL)
FIRST_LEVEL, LAST_LEVEL = Field('first_level', 1, _GLOBAL), Field('last_level', 1, _GLOBAL)
PENALTIES = Field('penalties', 1, _GLOBAL)
LARGEST_VIOLATION = Field('largest_violation', 1, _GLOBAL)
MISSED = Field('missed', 1, _GLOBAL)
LARGEST_MULTIPLIER = Field('largest_multiplier', 1, _GLOBAL)  # of all limits
LEAST_CONE_SLACK = Field('least_cone_slack', 1, _GLOBAL)  # at nodes k >= 1
POSE = Field('pose', 12, _MODEL)
