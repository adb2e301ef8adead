# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The search finds the global minimum: reference values, and IPOPT from many starts.

`benchmarks/global_minimum.py` runs the same comparison with more instances and many more starts.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from cases import LIMITED, PROBLEMS, REFERENCE, cold, random_states, rest_states
from oracle_starts import best
from strategies import generator, half_turns

from manifold_mpc_ros.lab.benchmark.peers.oracle import Oracle, steps_of
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

Make = Callable[..., AttitudeMpc]
States = list[tuple[Array, Array]]

TOLERANCE = 1e-6
AXES = dict(zip('xyz', np.eye(3)))


class Outcome(NamedTuple):
    """Relative excess of our cost over IPOPT's from our plan, and over its best elsewhere."""

    over_polished: float
    over_best: float
    largest_torque: float
    converged: bool


def compare(mpc: AttitudeMpc, states: States, *, octants: int, randoms: int) -> list[Outcome]:
    """Solve every state cold with the controller, and with the oracle."""
    oracle = Oracle(mpc.config, mpc.terminal.P, mpc.terminal.c)
    rng, outcomes = generator('oracle starts'), []
    for R, omega in states:
        plan = cold(mpc).solve(R, omega)
        assert plan.status in (SolveStatus.CONVERGED, SolveStatus.FEASIBLE)
        steps = steps_of(plan.R_NB, plan.omega_BN_B, mpc.config)
        polished = oracle.solve(R, omega, steps, polish=True)
        found = best(oracle, R, omega, rng, octants=octants, randoms=randoms)
        outcomes.append(Outcome(plan.cost / polished.cost - 1, plan.cost / found.cost - 1,
                                float(np.abs(plan.torque_B_n_m).max()),
                                plan.status is SolveStatus.CONVERGED))
    return outcomes


def assert_global(outcomes: list[Outcome]) -> None:
    """Check that IPOPT confirms every cost and beats none, and that it was a real contest.

    A cost below IPOPT's best is allowed, since IPOPT has confirmed it.
    """
    polished, excess, _, converged = np.array(outcomes).T
    assert np.flatnonzero(np.abs(polished) > TOLERANCE).tolist() == []
    assert np.flatnonzero(excess > TOLERANCE).tolist() == []
    assert np.mean(np.abs(excess) < TOLERANCE) > 0.9
    assert np.mean(converged) > 0.97


@pytest.mark.parametrize(('inertia', 'axis', 'cost'), [
    ((1.0, 1.0, 1.0), 'x', 27.9284), ((1.0, 1.0, 1.0), 'y', 27.9284),
    ((1.0, 1.0, 1.0), 'z', 27.9284), ((1.0, 0.9, 0.6), 'x', 27.9284),
    ((1.0, 0.9, 0.6), 'y', 26.6196), ((1.0, 0.9, 0.6), 'z', 22.2893)])
def test_reference_costs_without_limits(
        controller: Make, inertia: tuple[float, ...], axis: str, cost: float) -> None:
    plan = controller(**REFERENCE, inertia_kg_m2=inertia).solve(
        half_turns(AXES[axis]), np.zeros(3))
    assert plan.cost == pytest.approx(cost, abs=5e-5)
    if inertia == (1.0, 1.0, 1.0):
        along = float(plan.torque_B_n_m @ AXES[axis])
        assert abs(along) == pytest.approx(1.1788, abs=5e-5)
        assert np.abs(plan.torque_B_n_m - along * AXES[axis]).max() < 1e-9


@pytest.mark.parametrize(('axis', 'cost', 'planar'), [
    ('x', 38.773, 53.231), ('y', 38.101, 49.552), ('z', 36.461, 39.131)])
def test_reference_costs_with_limits(
        controller: Make, axis: str, cost: float, planar: float) -> None:
    """The best plans leave the plane at once with all three torques saturated."""
    mpc = controller(**LIMITED)
    state = (half_turns(AXES[axis]), np.zeros(3))
    plan = mpc.solve(*state)
    assert plan.cost == pytest.approx(cost, abs=5e-4)
    assert np.abs(plan.torque_B_n_m) == pytest.approx(np.full(3, 0.3), abs=1e-6)
    oracle = Oracle(mpc.config, mpc.terminal.P, mpc.terminal.c)
    slew = best(oracle, *state, generator('planar'), octants=0, randoms=0)
    assert slew.cost == pytest.approx(planar, abs=5e-4)


def test_half_turns_at_rest_without_limits(controller: Make) -> None:
    outcomes = compare(controller(**REFERENCE), rest_states(50), octants=0, randoms=1)
    assert_global(outcomes)
    assert min(outcome.largest_torque for outcome in outcomes) > 0.3


def test_half_turns_at_rest_with_limits(controller: Make) -> None:
    """Opposite octants are mirror images here, so four of them are enough."""
    outcomes = compare(controller(**LIMITED), rest_states(50), octants=4, randoms=0)
    assert_global(outcomes)
    assert min(outcome.largest_torque for outcome in outcomes) > 0.29


def test_random_states_without_limits(controller: Make) -> None:
    states = random_states('global, free', 100, 0.6)
    assert_global(compare(controller(**REFERENCE), states, octants=0, randoms=1))


def test_random_states_with_limits(controller: Make) -> None:
    states = random_states('global, limited', 100, 0.5)
    assert_global(compare(controller(**LIMITED), states, octants=3, randoms=0))


def state(phi: list[float], omega: list[float]) -> tuple[Array, Array]:
    """Return the attitude of a rotation vector, and a rate."""
    return so3.exp(np.array(phi)), np.array(omega)


# A problem, a state, and the best cost that IPOPT has found from 18 starts.
PATIENT: dict[str, tuple[str, tuple[Array, Array], float]] = {
    'long_way': ('limited', state(
        [1.75894848, 0.71608588, 2.11379501], [0.0167578, 0.39105998, 0.16924071]), 28.713861),
    'octant': ('limited', state(
        [-3.04603021, -0.0515779, -0.6142519], [-0.04579043, -0.32139557, -0.22837406]),
        34.995623),
    'half_turn': ('limited_symmetric', rest_states(24)[26], 26.169820),
    'free_axis': ('free_axes', state(
        [2.42894414, -0.18734782, 0.00926587], [0.35173138, -0.16730994, 0.34156634]),
        34.815467),
}


@pytest.mark.parametrize('name', sorted(PATIENT))
def test_starts_that_are_slow_to_become_the_best(controller: Make, name: str) -> None:
    """After a dozen passes these cost three times what another start does, and they win."""
    kind, (R, omega), cost = PATIENT[name]
    plan = controller(**PROBLEMS[kind]).solve(R, omega)
    assert plan.cost == pytest.approx(cost, rel=TOLERANCE)


@pytest.mark.parametrize('kind', sorted(set(PROBLEMS) - {'free', 'limited'}))
def test_other_problems(controller: Make, kind: str) -> None:
    """Instances that are feasible, half of them half turns at rest."""
    states = [*rest_states(1), *random_states('global, other', 4, 0.25)]
    assert_global(compare(controller(**PROBLEMS[kind]), states, octants=6, randoms=0))
