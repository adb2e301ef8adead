# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Horizons whose steps grow: plans are true, limits hold, loops settle as with equal steps."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from cases import CERTIFIED, configuration, random_states
from reference import closed_loop

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.reference import Reference
from manifold_mpc_ros.mpc.solution import SolveStatus

# 5 s ahead with a period of 0.05 s: 100 equal steps.
GRADED = configuration(**{**CERTIFIED, 'step_s': 0.05, 'horizon': 30, 'horizon_s': 5.0})
R_START = so3.exp(np.radians(60.0) * np.array([0.6, -0.64, 0.48]))


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    """Return the controller of a graded horizon."""
    return AttitudeMpc(GRADED)


def test_steps_grow_and_add_up() -> None:
    steps = GRADED.steps
    assert (steps.periods[:6] == 1.0).all()
    growth = steps.periods[7:] / steps.periods[6:-1]
    np.testing.assert_allclose(growth, growth[0])
    assert growth[0] > 1.0
    assert steps.times_s[-1] == pytest.approx(5.0, rel=1e-12)
    assert steps.in_periods == GRADED.with_equal_steps.horizon == 100


@pytest.mark.parametrize(('changes', 'valid'), [
    ({'horizon_s': 1.5}, 'more than horizon [*] step_s = 1.5'), ({'horizon': 6}, 'more than 6'),
    ({'forcing': 'paper'}, '0 with cones'), ({'horizon_s': -1.0}, 'at least 0'),
    ({'wheels': WheelArray(np.eye(3), 0.1, 1.0)}, 'with wheels'),
    ({'cones': [Cone('sun', (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.5)]}, '0 with cones'),
    ({'horizon_s': 60.0}, 'limits with step_s')])
def test_what_cannot_be_is_refused(changes: dict[str, object], valid: str) -> None:
    with pytest.raises(ConfigurationError, match=valid):
        replace(GRADED, **changes)


def test_a_reference_is_refused(mpc: AttitudeMpc) -> None:
    with pytest.raises(ConfigurationError, match='horizon_s'):
        mpc.solve(R_START, np.zeros(3), reference=Reference.fixed(np.eye(3), GRADED.horizon))


@pytest.mark.parametrize('moves', ['reference.timeout_s', 'slew_profile.torque_fraction'])
def test_a_controller_whose_targets_move_is_refused(moves: str) -> None:
    values = resolve_parameters(CONTROLLER_PARAMETERS, {'mpc.horizon_s': 10.1, moves: 0.5},
                                complete=False)
    with pytest.raises(ConfigurationError, match='0 with targets that move'):
        ControllerConfig.from_parameters(values)


def test_a_plan_is_a_trajectory_of_the_model(mpc: AttitudeMpc) -> None:
    """Nodes follow from the torques by LGVI steps of the steps' own lengths."""
    mpc.reset()
    plan = mpc.solve(R_START, [0.1, -0.2, 0.05])
    state = plan.R_NB[0], plan.omega_BN_B[0]
    for k, periods in enumerate(GRADED.steps.periods):
        state = lgvi_step(*state, plan.torques_B_n_m[k], inertia_kg_m2=GRADED.inertia_kg_m2,
                          step_s=periods * GRADED.step_s)
        np.testing.assert_allclose(plan.R_NB[k + 1], state[0], atol=1e-8)
        np.testing.assert_allclose(plan.omega_BN_B[k + 1], state[1], atol=1e-8)
    assert plan.status is SolveStatus.CONVERGED
    assert np.abs(plan.torques_B_n_m).max() <= 0.3
    assert np.abs(plan.omega_BN_B).max() <= 0.6 * (1 + 1e-6)


def test_steps_that_hardly_grow_are_equal_ones() -> None:
    equal = configuration(**CERTIFIED)
    graded = replace(equal, horizon_s=10.0 * (1.0 + 1e-9))
    plan, expected = (AttitudeMpc(each).solve(R_START, [0.1, 0.0, -0.1])
                      for each in (graded, equal))
    assert plan.cost == pytest.approx(expected.cost, rel=1e-6)
    np.testing.assert_allclose(plan.torques_B_n_m, expected.torques_B_n_m, atol=1e-5)


def test_loops_settle_and_the_value_decreases(mpc: AttitudeMpc) -> None:
    """The bound on the decrease is what docs/theory.md, section 17, leaves open, measured."""
    for (R, _), omega in zip(random_states('graded', 6, 0.0), np.eye(3).repeat(2, axis=0) * 0.1):
        loop = closed_loop(mpc, so3.exp(0.4 * so3.log(R)), omega, 240)
        assert all(tick.plan.status is SolveStatus.CONVERGED for tick in loop)
        for now, after in itertools.pairwise(loop):
            assert after.plan.cost <= now.plan.promised_cost + 0.1 * now.stage_cost + 1e-7
        assert np.degrees(so3.angle(loop[-1].plan.R_NB[0])) < 0.1
        assert max(np.abs(tick.plan.omega_BN_B[0]).max() for tick in loop) <= 0.6 * (1 + 1e-6)
