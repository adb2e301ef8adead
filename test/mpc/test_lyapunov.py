# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's theorem along closed loops in D_N: V(x+) - V(x) <= -L, and feasible for ever.

V is the value of the plan. The plant is the predictor's own model, as the theorem has it; all
limits and the terminal set are on.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from cases import CERTIFIED, LIMITS, configuration, random_states, rest_states
from reference import Tick, closed_loop
from strategies import generator, rates

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

Make = Callable[..., AttitudeMpc]
Loops = list[list[Tick]]

TICKS = 60
# Measured: 4e-13 over 426 loops, N = 16 and 20.
TOLERANCE = 1e-7


def states(kind: str) -> list[tuple[Array, Array]]:
    """Return 13 half turns at rest, or 20 uniform attitudes with rates up to 0.3 rad/s."""
    if kind == 'half_turns':
        return rest_states(10)
    return [(R, omega) for (R, _), omega in zip(
        random_states('lyapunov', 20, 0.0), rates(generator('lyapunov'), 20, 0.3))]


@pytest.fixture(scope='module', params=['half_turns', 'random'])
def loops(request: pytest.FixtureRequest, controller: Make) -> Loops:
    """Return closed loops of 30 s from states in D_N."""
    mpc = controller(**CERTIFIED)
    started = [closed_loop(mpc, *state, TICKS) for state in states(request.param)]
    inside = [loop for loop in started if loop[0].plan.status is not SolveStatus.INFEASIBLE]
    assert len(inside) >= 0.9 * len(started)
    return inside


def broken_promises(loop: list[Tick]) -> Array:
    """Return ``V(x+) - V(x) + L`` (n,), relative to V(x) with a floor: the decrease's excess."""
    return np.array([
        (after.plan.cost - now.plan.cost + now.stage_cost) / max(now.plan.cost, 1e-3)
        for now, after in itertools.pairwise(loop)])


def test_the_value_decreases_by_the_stage_cost(loops: Loops) -> None:
    for loop in loops:
        assert broken_promises(loop).max() <= TOLERANCE
        assert loop[-1].plan.cost < 1e-3 * loop[0].plan.cost


def test_a_feasible_start_stays_feasible(loops: Loops) -> None:
    for loop in loops:
        assert {tick.plan.status for tick in loop} <= {
            SolveStatus.CONVERGED, SolveStatus.FEASIBLE}


def test_the_loop_keeps_its_limits(loops: Loops) -> None:
    for loop in loops:
        assert max(np.abs(tick.plan.torque_B_n_m).max() for tick in loop) <= 0.3
        assert max(np.abs(tick.omega).max() for tick in loop) <= (
            LIMITS['max_rate_rad_s'] * (1 + 1e-6))


def test_the_loop_settles(loops: Loops) -> None:
    for loop in loops:
        assert np.degrees(so3.angle(loop[-1].R)) < 0.1
        assert np.linalg.norm(loop[-1].omega) < 1e-3


def continued(q: Array, R: Array) -> Array:
    """Return the quaternion of R that is nearer to q."""
    following = so3.quaternion_from_rotation(R)
    return following if following @ q >= 0 else -following


def side_of_turn(q: Array, tick: Tick) -> float:
    """Return at which of the identity's two quaternions a plan ends that starts from q."""
    return float(np.sign(functools.reduce(continued, tick.plan.R_NB[1:], q)[0]))


def test_the_side_of_the_turn_changes_at_most_once(loops: Loops) -> None:
    """The loop's quaternion, continued without jumps, ends where its plans say it will."""
    for loop in loops:
        q, sides = so3.quaternion_from_rotation(loop[0].R), []
        for tick in loop:
            q = continued(q, tick.R)
            sides.append(side_of_turn(q, tick))
        assert sides[-1] == np.sign(q[0])
        assert sum(one != other for one, other in itertools.pairwise(sides)) <= 1


def test_a_terminal_cost_that_is_too_small_breaks_the_decrease(
        controller: Make, cache_dir: str) -> None:
    """With a hundredth of P the plans promise what the loop cannot keep."""
    design = controller(**CERTIFIED).terminal
    short = configuration(**{**CERTIFIED, 'horizon': 4})
    weak = replace(design, P=0.01 * design.P, c=0.01 * design.c)
    broken = {}
    for name, terminal in (('right', design), ('weak', weak)):
        mpc = AttitudeMpc(short, cache_dir=cache_dir, terminal=terminal)
        loop = closed_loop(mpc, so3.exp(np.array([0.1, -0.05, 0.08])), np.zeros(3), 8)
        assert {tick.plan.status for tick in loop} == {SolveStatus.CONVERGED}
        broken[name] = broken_promises(loop).max()
    assert broken['right'] <= TOLERANCE
    assert broken['weak'] > 100 * TOLERANCE
