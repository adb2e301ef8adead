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
from manifold_oracle import ManifoldOracle
from strategies import half_turns

from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.theory.manifold_mpc import PlanStatus

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
