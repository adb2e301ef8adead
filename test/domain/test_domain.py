# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""D_N on samples: nested, confirmed by numpy, by the controller's status and by IPOPT."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cases import configuration
from oracle_starts import best
from strategies import generator

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step, step_rotation
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.benchmark.peers.oracle import Oracle
from manifold_mpc_ros.lab.domain import domain
from manifold_mpc_ros.lab.domain import states as domain_states
from manifold_mpc_ros.lab.domain.domain import NONE, Domain, Round, Settings, smallest_horizons
from manifold_mpc_ros.lab.domain.feasibility import Feasibility
from manifold_mpc_ros.lab.domain.picture import smoothed
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.problem_of import terminal_design

# Strong torques and a soft law: no state at rest needs more than three steps.
QUICK: dict[str, Any] = {
    'forcing': 'symmetric', 'max_torque_n_m': 0.8, 'torque_weight': 20 * np.eye(3), 'horizon': 3}
SETTINGS = Settings()


@pytest.fixture(scope='module')
def config() -> AttitudeMpcConfig:
    return configuration(**QUICK)


@pytest.fixture(scope='module')
def terminal(config: AttitudeMpcConfig) -> TerminalDesign:
    return terminal_design(config)


@pytest.fixture(scope='module')
def searches(config: AttitudeMpcConfig, terminal: TerminalDesign) -> dict[int, Feasibility]:
    return {n: Feasibility(replace(config, horizon=n), terminal) for n in (1, 2, 3)}


@pytest.fixture(scope='module')
def asked(config: AttitudeMpcConfig, terminal: TerminalDesign) -> tuple[list[Domain], list[Round]]:
    """Return a grid, half turns and a grid with rates, asked for their smallest N."""
    rounds: list[Round] = []
    groups = [domain_states.uniform_states(config, 24), domain_states.half_turns(config, 4),
              domain_states.moving_states(config, 12, 0.3)]
    return smallest_horizons(config, terminal, groups, settings=SETTINGS,
                             progress=rounds.append), rounds


def states_of(found: list[Domain]) -> list[tuple[Array, Array, int]]:
    """Return every state as (R_NB, omega, smallest N)."""
    return [(so3.exp(vector), rate, int(n)) for group in found for vector, rate, n
            in zip(group.states.vectors, group.states.rates, group.smallest)]


def ratio(terminal: TerminalDesign, config: AttitudeMpcConfig, R: Array, omega: Array) -> float:
    """Return ``xi^T P xi / c`` by the formulas of the paper, in numpy."""
    step = step_rotation(omega, config.inertia_kg_m2, config.step_s)
    xi = np.concatenate([so3.log(R), so3.log(step) / config.step_s])
    return float(xi @ terminal.P @ xi / terminal.c)


def test_every_smallest_horizon_occurs(asked: tuple[list[Domain], list[Round]]) -> None:
    found, _ = asked
    assert {n for _, _, n in states_of(found)} == {0, 1, 2, 3}
    assert found[1].largest == 3
    assert [group.smallest.shape for group in found] == [(24,), (7,), (12,)]


def test_the_domains_are_nested(
    asked: tuple[list[Domain], list[Round]], searches: dict[int, Feasibility],
) -> None:
    """A plan of n steps is found exactly when n is at least the smallest N: D_n in D_n+1."""
    for R, omega, smallest in states_of(asked[0]):
        found = [searches[n].plan(R, omega) is not None for n in (1, 2, 3)]
        assert found == [n >= smallest for n in (1, 2, 3)]
    for group in asked[0]:
        for n in range(3):
            assert np.all(group.inside(n) <= group.inside(n + 1))
        assert group.inside(3).all()


def test_plans_end_in_the_terminal_set_and_go_on_in_it(
    asked: tuple[list[Domain], list[Round]], searches: dict[int, Feasibility],
    terminal: TerminalDesign, config: AttitudeMpcConfig,
) -> None:
    """Rolled out in numpy; then one step of the local law, which is why D_N is nested."""
    h, J, limit = config.step_s, config.inertia_kg_m2, config.max_torque_n_m
    for R, omega, smallest in states_of(asked[0]):
        assert (ratio(terminal, config, R, omega) <= 1) == (smallest == 0)
        plan = searches[smallest].plan(R, omega) if smallest else np.zeros((0, 3))
        assert plan is not None
        assert plan.shape == (smallest, 3)
        for k in range(smallest + 1):
            if k == smallest:
                assert ratio(terminal, config, R, omega) <= 1 + 1e-6
                step = step_rotation(omega, J, h)
                torque = terminal.K @ np.concatenate([so3.log(R), so3.log(step) / h])
            else:
                torque = plan[k]
            assert np.all(np.abs(torque) <= limit * (1 + 1e-6))
            R, omega = lgvi_step(R, omega, torque, inertia_kg_m2=J, step_s=h)
        assert ratio(terminal, config, R, omega) <= 1 + 1e-6


def test_the_controller_says_the_same(
    asked: tuple[list[Domain], list[Round]], terminal: TerminalDesign, config: AttitudeMpcConfig,
) -> None:
    """Its status is 'infeasible' with one step less, and is not with N: four states of each N."""
    by_horizon: dict[int, list[tuple[Array, Array]]] = {2: [], 3: []}
    for R, omega, smallest in states_of(asked[0]):
        if smallest in by_horizon:
            by_horizon[smallest].append((R, omega))
    controllers = {n: AttitudeMpc(replace(config, horizon=n), terminal=terminal)
                   for n in (1, 2, 3)}
    for smallest, states in by_horizon.items():
        assert len(states) >= 2
        for R, omega in states[:4]:
            statuses = []
            for n in (smallest - 1, smallest):
                controllers[n].reset()
                statuses.append(controllers[n].solve(R, omega).status)
            assert statuses[0] == SolveStatus.INFEASIBLE
            assert statuses[1] in (SolveStatus.CONVERGED, SolveStatus.FEASIBLE)


def test_ipopt_says_the_same(
    asked: tuple[list[Domain], list[Round]], terminal: TerminalDesign, config: AttitudeMpcConfig,
) -> None:
    """From several starts IPOPT finds a plan of N steps, and none of N - 1."""
    oracles = {n: Oracle(replace(config, horizon=n), terminal.P, terminal.c) for n in (1, 2, 3)}
    chosen = [state for smallest in (2, 3) for state in
              [s for s in states_of(asked[0]) if s[2] == smallest][:2]]
    assert len(chosen) == 4
    for R, omega, smallest in chosen:
        costs = [best(oracles[n], R, omega, generator('domain'), octants=2, randoms=0).cost
                 for n in (smallest - 1, smallest)]
        assert [bool(np.isfinite(cost)) for cost in costs] == [False, True]


def test_the_search_says_how_far_it_is(asked: tuple[list[Domain], list[Round]]) -> None:
    _, rounds = asked
    ends = [now for now in rounds if now.tried == now.to_try]
    assert [now.number for now in ends] == list(range(1, len(ends) + 1))
    assert ends[0].horizons == (3,)
    assert ends[0].found == ends[0].tried
    assert ends[-1].decided == ends[-1].states == 43
    decided = [now.decided for now in rounds]
    assert decided == sorted(decided)


def test_workers_do_not_change_the_answer(
    asked: tuple[list[Domain], list[Round]], terminal: TerminalDesign, config: AttitudeMpcConfig,
) -> None:
    groups = [group.states for group in asked[0]]
    again = smallest_horizons(config, terminal, groups, settings=replace(SETTINGS, workers=2))
    for one, two in zip(asked[0], again):
        assert np.array_equal(one.smallest, two.smallest)


def test_the_largest_alone_takes_fewer_questions(
    asked: tuple[list[Domain], list[Round]], terminal: TerminalDesign, config: AttitudeMpcConfig,
) -> None:
    rounds: list[Round] = []
    (grid,) = smallest_horizons(config, terminal, [asked[0][0].states], settings=SETTINGS,
                                only_largest=True, progress=rounds.append)
    assert grid.largest == asked[0][0].largest
    assert np.all(grid.smallest >= asked[0][0].smallest)
    assert all(len(now.horizons) == 1 for now in rounds)


def test_states_that_nothing_reaches_from_are_reported(
    asked: tuple[list[Domain], list[Round]], terminal: TerminalDesign, config: AttitudeMpcConfig,
) -> None:
    """With at most two steps the half turns that need three have no plan."""
    known = asked[0][1]
    (again,) = smallest_horizons(config, terminal, [known.states],
                                 settings=replace(SETTINGS, largest=2))
    assert np.array_equal(again.smallest, np.where(known.smallest > 2, NONE, known.smallest))
    assert again.largest == NONE
    assert again.smallest[again.hardest] == NONE
    assert not again.inside(160)[again.hardest]


def test_states_in_the_terminal_set_need_no_step(
    terminal: TerminalDesign, config: AttitudeMpcConfig,
) -> None:
    """On both sides of its edge at rest, in 20 directions."""
    axes = domain_states.half_turns(config, 17).vectors / np.pi
    edge = np.sqrt(terminal.c / np.einsum('ni,ij,nj->n', axes, terminal.P[:3, :3], axes))
    for factor, inside in ((1 - 1e-6, True), (1 + 1e-4, False)):
        states = domain_states.States('edge', factor * edge[:, None] * axes, np.zeros((20, 3)))
        (found,) = smallest_horizons(config, terminal, [states], settings=SETTINGS)
        assert np.all((found.smallest == 0) == inside)


def test_rates_are_bounded_by_what_was_asked(config: AttitudeMpcConfig) -> None:
    moving = domain_states.moving_states(config, 200, 0.3)
    lengths = np.linalg.norm(moving.rates, axis=1)
    assert 0.29 < lengths.max() <= 0.3
    assert np.array_equal(moving.vectors, domain_states.uniform_states(config, 200).vectors)
    # lambda_min / (h lambda_max) = 0.6 / 0.5 rad/s: beyond it a step need not exist.
    domain_states.moving_states(config, 20, 1.19)
    with pytest.raises(ConfigurationError, match=r'below 1\.2'):
        domain_states.moving_states(config, 20, 1.2)


def test_pointing_asks_directions() -> None:
    """Gamma = R_NB^T b covers S^2; the antipode, opposite to b, is the hardest."""
    config = configuration(**QUICK, target='pointing', pointing_axis_B=(0.0, 0.6, 0.8))
    b, terminal = config.pointing_axis_B, terminal_design(config)
    grid, turn = domain_states.uniform_states(config, 8), domain_states.half_turns(config, 9)
    assert grid.covering_rad is not None
    assert np.abs(grid.vectors @ b).max() < 1e-12
    gamma = np.einsum('nji,j->ni', so3.exp(grid.vectors), b)
    assert np.abs(gamma.mean(axis=0)).max() < 2 / 8
    assert np.abs(np.cos(np.linalg.norm(grid.vectors, axis=1)) - gamma @ b).max() < 1e-12
    assert np.allclose(so3.exp(turn.vectors[0]).T @ b, -b)
    found = smallest_horizons(config, terminal, [grid, turn], settings=SETTINGS)
    assert found[1].largest >= found[0].largest >= 1
    (plane,) = domain_states.planes(config)
    assert np.allclose(np.cross(*plane.axes.T), b)


def test_planes_cover_the_disc(config: AttitudeMpcConfig) -> None:
    for plane in domain_states.planes(config):
        states = domain_states.plane_states(plane, 21)
        points = plane.points(21)
        lengths = np.linalg.norm(points, axis=-1)
        assert plane.covered(21)[lengths <= np.pi].all()
        assert len(states) == np.count_nonzero(plane.covered(21))
        assert np.allclose(states.vectors @ plane.axes, points[plane.covered(21)])
        assert domain.NONE not in plane.covered(21)


def test_a_plan_keeps_the_cones_and_from_inside_there_is_none() -> None:
    sun = Cone('sun', (1.0, 0.0, 0.0), (0.5, 0.866, 0.05), 0.4)
    free = configuration(forcing='symmetric', max_torque_n_m=0.8, max_rate_rad_s=0.4, horizon=16)
    with_cone = replace(free, cones=(sun,))
    behind, inside = so3.exp([0.0, 0.0, 2.1]), so3.exp([0.0, 0.0, 1.05])
    least = []
    for config in (free, with_cone):
        search = Feasibility(config, terminal_design(config))
        torques, R, omega = search.plan(behind, np.zeros(3)), behind, np.zeros(3)
        assert torques is not None
        margins = []
        for torque in torques:
            R, omega = lgvi_step(R, omega, torque, inertia_kg_m2=config.inertia_kg_m2,
                                 step_s=config.step_s)
            margins.append(float(sun.margins_rad(R)))
        least.append(min(margins))
        assert (search.plan(inside, np.zeros(3)) is None) == bool(config.cones)
    assert least[0] < -0.1
    assert least[1] >= 0.0


def test_no_colour_lies_between_a_horizon_and_none_at_all() -> None:
    field = np.full((9, 9), 12.0)
    field[:, 5:], field[0, 0] = NONE, np.nan
    horizons, outside = smoothed(field)
    np.testing.assert_allclose(horizons[:, :7], 12.0)
    np.testing.assert_array_equal(outside > 0.5, field == NONE)
