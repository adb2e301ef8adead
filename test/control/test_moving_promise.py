# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What plans about fast targets promise: kept by the model, and by a body in continuous time."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, configuration

from manifold_mpc_ros.control.decrease_record import Decrease
from manifold_mpc_ros.control.moving.promise import MovingPromise
from manifold_mpc_ros.lab.closed_loop import ModelPlant
from manifold_mpc_ros.lab.tracking.body import ContinuousBody
from manifold_mpc_ros.lab.tracking.flight import Flight, fly, trajectory
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.reference import Reference

H = 0.5
CONFIG = configuration(**{**CERTIFIED, 'step_s': H, 'horizon': 20})
CLOSE = so3.exp([0.05, -0.05, 0.1])
AXIS = np.array([1.0, 0.5, -0.3]) / np.linalg.norm([1.0, 0.5, -0.3])


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(CONFIG, moving=True)


def swing(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A swing about a skew axis, by up to 0.4 rad/s."""
    w = 2.0 * np.pi / 25.0
    return (so3.exp(1.6 * np.sin(w * times)[:, None] * AXIS),
            1.6 * w * np.cos(w * times)[:, None] * AXIS)


def flight(mpc: AttitudeMpc, kind: str) -> Flight:
    R_0, omega_0 = swing(np.zeros(1))
    body: Any = ModelPlant(CONFIG, R_0[0] @ CLOSE, omega_0[0]) if kind == 'model' else (
        ContinuousBody(CONFIG.inertia_kg_m2, step_s=H / 20, R_NB=R_0[0] @ CLOSE,
                       omega_BN_B=omega_0[0], max_torque_n_m=CONFIG.max_torque_n_m))
    return fly(mpc, body, trajectory(swing, 60.0, 0.5), 45.0)


@pytest.mark.parametrize('kind', ['model', 'continuous'])
def test_promises_about_a_fast_target_are_kept(mpc: AttitudeMpc, kind: str) -> None:
    flown = flight(mpc, kind)
    records = [each.decrease for each in flown.commands]
    last = records[-1]
    assert last is not None
    assert last.counters.broken == 0
    assert last.counters.checked >= 85
    # V - L alone would not be: there a fixed target would have it, this one is no motion of the
    # model, and its own cost at the end of the horizon changes.
    plans = [each.solution for each in flown.commands]
    rises = [after.cost - before.promised_cost - (before.cost - before.promised_cost)
             for before, after in itertools.pairwise(plans)
             if before is not None and after is not None]
    assert max(rises) > 0.0


def test_what_is_allowed_for_is_nothing_at_rest_and_no_promise_beyond_the_limits(
    mpc: AttitudeMpc,
) -> None:
    mpc.reset()
    judge = MovingPromise(CONFIG, mpc.terminal)
    still = Reference.fixed(np.eye(3), CONFIG.horizon)
    plan = mpc.solve(CLOSE, np.zeros(3), reference=still)
    end = Reference.fixed(np.eye(3), 1)
    allowed = judge.allowance(plan, end, np.zeros(3))
    assert allowed.why_none == ''
    assert allowed.excess == 0.0
    assert allowed.model_error < 1e-6
    assert judge.allowance(plan._replace(limits_used=1.5), end, np.zeros(3)).why_none
    jumped = replace(end, R_ND=np.stack([np.eye(3), so3.exp([0.0, 0.0, 2.0])]))
    assert judge.allowance(plan, jumped, np.zeros(3)).why_none


def test_a_target_beyond_the_limits_promises_nothing(mpc: AttitudeMpc) -> None:
    def fast(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        R, omega = swing(2.0 * times)
        return R, 2.0 * omega

    body = ModelPlant(CONFIG, CLOSE)
    flown = fly(mpc, body, trajectory(fast, 30.0, 0.25), 20.0)
    beyond = [index for index, each in enumerate(flown.commands)
              if each.solution is not None and each.solution.limits_used > 1.0]
    assert beyond
    verdicts = [each.decrease.verdict for each in flown.commands if each.decrease is not None]
    assert {verdicts[index + 1] for index in beyond[:-1]} == {Decrease.NONE}
