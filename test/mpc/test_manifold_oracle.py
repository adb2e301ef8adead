# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The fast solver and the general one find the same value, for attitude and for pointing.

They share the configuration, the formulas of `problems` and the terminal design, and no part of
the optimiser or of its starts.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cases import LIMITED, REFERENCE, random_states
from manifold_oracle import ManifoldOracle, point_of
from strategies import half_turns

from manifold_mpc_ros.lab.discontinuity.discontinuity import jump_of_side
from manifold_mpc_ros.lab.reference.manifold_mpc import PlanStatus
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

AXIS = np.array([0.6, 0.0, 0.8])
POINTING: dict[str, Any] = {'target': 'pointing', 'pointing_axis_B': tuple(AXIS)}


@pytest.mark.parametrize(('changes', 'starts'), [
    (REFERENCE, 3), (LIMITED, 10), ({**REFERENCE, **POINTING}, 4), ({**LIMITED, **POINTING}, 6)],
    ids=['attitude', 'attitude with limits', 'pointing', 'pointing with limits'])
def test_the_fast_solver_finds_the_same_value(
    changes: dict[str, Any], starts: int, controller: Callable[..., AttitudeMpc],
) -> None:
    fast = controller(**changes)
    oracle = ManifoldOracle(fast.config, starts=starts)
    assert np.allclose(fast.terminal.P, oracle.mpc.terminal.P, rtol=0, atol=1e-8)
    # Half a turn about y of the body: 180 degrees off, and exactly so for the axis as well.
    turned = half_turns(np.array([0.0, 1.0, 0.0]))
    for state in ((turned, np.zeros(3)), *random_states('oracle', 1, 0.3)):
        fast.reset()
        ours, best = fast.solve(*state), oracle.best(*state)
        assert best.status is PlanStatus.OPTIMAL
        assert ours.cost == pytest.approx(best.value, rel=1e-6)
        assert ours.promised_cost == pytest.approx(best.promised, rel=1e-5)


def test_beside_180_degrees_the_oracle_takes_the_same_side(
    controller: Callable[..., AttitudeMpc],
) -> None:
    """About an axis that is not principal the law jumps beside 180 degrees, not on it.

    From exactly 180 degrees both ways round are optima, and their costs differ: there is no tie.
    """
    fast, axis = controller(**REFERENCE), np.array([1.0, -2.0, 3.0]) / np.sqrt(14.0)
    oracle = ManifoldOracle(fast.config, starts=2)
    at, _ = jump_of_side(fast, axis, 5.0, 1e-3)
    assert 0.02 < abs(at - 180.0) < 0.2
    point = point_of(fast.config, half_turns(axis), np.zeros(3))
    sides = [oracle.mpc.ocp.solve(point, start) for start in oracle.mpc.starts(point)]
    turns = [plan.controls[0] @ axis for plan in sides]
    assert min(turns) < -1.0
    assert max(turns) > 1.0
    assert abs(sides[0].value - sides[1].value) > 1e-4
    for angle in (180.0, at - 0.01, at + 0.01):
        R = so3.exp(np.radians(angle) * axis)
        fast.reset()
        ours, best = fast.solve(R, np.zeros(3)), oracle.best(R, np.zeros(3))
        assert ours.cost == pytest.approx(best.value, rel=1e-9)
        assert np.allclose(ours.torque_B_n_m, best.control, atol=1e-5)
        assert (best.control @ axis < 0) == (angle < at)
