# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Directions that move are followed at a constant rate; jumps, noise and nonsense are not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from scripted import CONFIG, STEP_NS, Script, loop_with
from strategies import generator

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.cone_guard import ConeGuard
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.control.moving.directions import ConeDirections, largest_rate_rad_s
from manifold_mpc_ros.control.tick_time import LOCKSTEP
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

Array = NDArray[np.float64]

SUN = Cone('sun', (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), np.radians(15.0))
BODY = AttitudeMpcConfig(
    inertia_kg_m2=CONFIG.inertia_kg_m2, step_s=0.5, horizon=20, attitude_weight=np.eye(3),
    rate_weight=CONFIG.rate_weight, torque_weight=2.0 * np.eye(3), max_torque_n_m=0.3,
    max_rate_rad_s=0.2, cones=(SUN,))
RATE = np.array([0.0, 0.0, -np.radians(0.5)])
START_NS = 10 ** 9


def sun(time_s: float, rate: Array = RATE, first: Array = SUN.direction_N) -> Array:
    return so3.exp(time_s * rate) @ first


def followed(*messages: tuple[float, Array]) -> ConeDirections:
    """Return what is known after messages (time [s], direction)."""
    known = ConeDirections(BODY)
    for time_s, direction in messages:
        known.take('sun', direction, START_NS + round(time_s * 1e9))
    return known


def test_a_direction_that_moves_is_known_at_every_node_and_holds_after_a_horizon() -> None:
    known = followed(*((t, sun(t)) for t in (0.0, 2.0, 4.0)))
    nodes = known.over_horizon(START_NS + round(4.5e9))['sun']
    assert nodes.shape == (21, 3)
    for k in range(20):
        np.testing.assert_allclose(nodes[k], sun(min(4.5 + 0.5 * k, 14.0)), atol=1e-12)
    late = known.over_horizon(START_NS + round(60e9))['sun']
    np.testing.assert_allclose(late, np.tile(sun(14.0), (21, 1)), atol=1e-12)
    assert known.rates_rad_s()['sun'] == pytest.approx(np.radians(0.5))
    # The next message of the same motion is no jump; one half a degree beside it is.
    assert not known.take('sun', sun(6.0), START_NS + round(6e9))
    assert known.take('sun', sun(9.0), START_NS + round(8e9))


@pytest.mark.parametrize('messages', [
    [(t, sun(0.0)) for t in (0.0, 2.0, 4.0)],                                   # at rest
    [(t, sun(t)) for t in (0.0, 2.0)],                                          # too few
    [(t, sun(t)) for t in (0.0, 0.1, 0.2)],                                     # too short
    [(0.0, sun(0.0)), (2.0, sun(20.0)), (4.0, sun(20.0))],                      # a jump
    [(t, sun(t, 50.0 * RATE)) for t in (0.0, 2.0, 4.0)],                        # too fast
    [(0.0, sun(0.0)), (2.0, sun(2.0)), (4.0, sun(4.0)), (4.0, sun(5.0))],       # not later
    [(t, sun(0.0) + 1e-3 * np.array([t % 3, 0.0, t % 2])) for t in range(9)],   # noise
    [(-1.0, sun(t)) for t in (0.0, 2.0, 4.0)],                                  # no stamp
], ids=lambda messages: f'{len(messages)} messages')
def test_what_does_not_move_steadily_is_taken_for_fixed(messages: list[tuple[float, Array]]
                                                       ) -> None:
    known = followed(*messages)
    seen = known.over_horizon(START_NS)['sun']
    np.testing.assert_array_equal(seen, messages[-1][1])  # (3,), to the last bit
    assert known.rates_rad_s()['sun'] == 0.0


def test_any_messages_give_unit_directions_no_faster_than_the_largest_rate() -> None:
    rng, most = generator('directions'), largest_rate_rad_s(BODY)
    assert 0.0 < most <= 0.1
    for _ in range(200):
        rate = rng.standard_normal(3) * 10.0 ** rng.uniform(-4, 1)
        first = so3.random_rotations(rng, 1)[0][0]
        times = np.cumsum(rng.uniform(-0.2, 3.0, 12))
        known = followed(*((t, sun(t, rate, first)) for t in times))
        nodes = np.atleast_2d(known.over_horizon(START_NS + round(1e9 * times[-1]))['sun'])
        np.testing.assert_allclose(np.linalg.norm(nodes, axis=1), 1.0, atol=1e-9)
        assert known.rates_rad_s()['sun'] <= most
        assert np.linalg.norm(np.diff(nodes, axis=0), axis=1).max(initial=0.0) <= 0.5 * most


def test_the_solver_is_told_where_a_direction_will_be() -> None:
    solver = Script(20)
    loop = loop_with(solver, BODY)
    for t in (0.0, 1.0, 2.0, 3.0):
        loop.direct('sun', sun(t), START_NS + round(t * 1e9))
        loop.admit(StateSample(START_NS + round(t * 1e9), np.eye(3), np.zeros(3)))
        loop.tick(LOCKSTEP)
    assert solver.directions_N is not None
    np.testing.assert_allclose(solver.directions_N['sun'][10], sun(8.0), atol=1e-12)


def test_a_stop_is_judged_by_where_the_cone_will_be() -> None:
    """At rest 25 degrees beside the Sun, which comes nearer by a degree a step."""
    guard, R, still = ConeGuard(BODY), so3.exp([0.0, 0.0, np.radians(25.0)]), np.zeros(3)
    fixed, turns = np.eye(3)[0], np.radians(np.arange(21.0))
    coming = np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
    np.testing.assert_array_equal(guard.keep(R, still, still, {'sun': fixed}), still)
    assert guard.keep(R, still, still, {'sun': coming}).any()
    # A plan that gives way in time is let through, though to stop now would end in the cone.
    towards, way = np.array([0.0, 0.0, -1e-3]), so3.exp(turns[:, None] * np.eye(3)[2]) @ R
    for plan_R_NB, allowed in ((np.tile(R, (21, 1, 1)), False), (way, True)):
        assert guard.allows(R, still, towards, {'sun': coming}, relaxed_R_NB=plan_R_NB) == allowed


def test_a_sun_that_passes_straight_through_the_target_breaks_no_cone() -> None:
    """A degree a second, a message each: a weak body is overtaken by what it takes for fixed."""
    weak, rate, least = dataclasses.replace(
        BODY, max_torque_n_m=0.05, max_rate_rad_s=0.1), 2.0 * RATE, []
    for stamped in (True, False):
        loop = loop_with(AttitudeMpc(weak), weak)
        R, omega, margins = np.eye(3), np.zeros(3), []
        for k in range(100):
            now_ns = START_NS + k * STEP_NS
            seen = sun(0.5 * k, rate, np.array([np.cos(0.5), np.sin(0.5), 0.0]))
            if k % 2 == 0:
                loop.direct('sun', seen, now_ns if stamped else 0)
            margins.append(float(SUN.margins_rad(R, seen)))
            loop.admit(StateSample(now_ns, R, omega))
            torque = loop.tick(LOCKSTEP).torque_B_n_m
            R, omega = lgvi_step(R, omega, torque, inertia_kg_m2=weak.inertia_kg_m2, step_s=0.5)
        least.append(np.degrees(min(margins)))
    assert least[0] > 1.0
    assert least[1] < 0.5
