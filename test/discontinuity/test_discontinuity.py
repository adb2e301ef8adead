# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Jumps are told from steep slopes, and the law has exactly those that the theory demands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from manifold_mpc_ros.lab.discontinuity import discontinuity as d
from manifold_mpc_ros.lab.discontinuity.findings import paper_config
from manifold_mpc_ros.lab.discontinuity.study import map_jumps, study_axis, study_circle
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

# Design page, trap 1: the first torque from 180 degrees for J = I without limits [N m].
FIRST_TORQUE = 1.1788


@pytest.fixture(scope='module')
def paper() -> AttitudeMpc:
    return AttitudeMpc(paper_config())


@pytest.fixture(scope='module')
def pointing() -> AttitudeMpc:
    return AttitudeMpc(replace(paper_config(), target='pointing'))


def along_x(value: Callable[[float], float]) -> d.Law:
    return lambda angle: np.array([value(angle), 0.0, 0.0])


def found(value: Callable[[float], float]) -> list[d.Jump]:
    grid = np.linspace(-1.0, 1.0, 12)
    law = along_x(value)
    return d.find_jumps(law, grid, np.array([law(angle) for angle in grid]))


def test_a_step_is_a_jump_wherever_it_is_and_its_sides_are_the_limits() -> None:
    [jump] = found(lambda angle: (2.0 if angle > 0.1234 else -1.0) + 0.1 * angle)
    assert jump.at_deg == pytest.approx(0.1234, abs=2e-9)
    assert jump.below_n_m[0] == pytest.approx(-1.0 + 0.01234, abs=1e-8)
    assert jump.above_n_m[0] == pytest.approx(2.0 + 0.01234, abs=1e-8)
    assert jump.size_n_m == pytest.approx(3.0, abs=1e-8)
    assert jump.widths_deg[-1] <= d.FINEST_DEG
    assert np.all(jump.differences_n_m >= 3.0 - 1e-12)


@pytest.mark.parametrize('slope', [1.0, 1e2, 1e6])
def test_a_steep_slope_is_no_jump(slope: float) -> None:
    assert found(lambda angle: float(np.tanh(slope * (angle - 0.1)))) == []


def test_every_jump_between_different_neighbours_is_found() -> None:
    jumps = found(lambda angle: float(angle > -0.4) + 2.0 * float(angle > 0.6))
    assert [round(jump.at_deg, 6) for jump in jumps] == [-0.4, 0.6]
    assert [round(jump.size_n_m, 6) for jump in jumps] == [1.0, 2.0]


@pytest.mark.parametrize('turns', [-2, -1, 0, 1, 3])
def test_the_winding_number_counts_turns(turns: int) -> None:
    phase = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    counted, largest = d.winding(2.0 + turns * phase + 0.4 * np.sin(2 * phase))
    assert counted == turns
    assert largest < np.pi


def test_the_hemisphere_is_even_and_no_axis_is_there_twice() -> None:
    axes = d.hemisphere(500)
    assert np.allclose(np.linalg.norm(axes, axis=1), 1.0)
    assert axes[:, 2].min() > 0
    assert np.allclose((axes.T @ axes) / 500, np.eye(3) / 3, atol=5e-3)
    apart = axes @ axes.T - 2 * np.eye(500)
    assert np.degrees(np.arccos(apart.max())) > 0.5 * np.degrees(np.sqrt(2 * np.pi / 500))


@pytest.mark.parametrize(('radius', 'phase'), [(20.0, 0.0), (5.0, 130.0), (1e-3, 271.0)])
def test_directions_beside_the_antipode_are_where_they_should_be(
    radius: float, phase: float, pointing: AttitudeMpc,
) -> None:
    b = pointing.config.pointing_axis_B
    basis = d.tangent_basis(b)
    gamma = d.attitude_of_direction(pointing.config, radius, phase).T @ b
    r, p = np.radians(radius), np.radians(phase)
    expected = -np.cos(r) * b + np.sin(r) * basis @ np.array([np.cos(p), np.sin(p)])
    assert np.allclose(gamma, expected, atol=1e-14)


@pytest.mark.parametrize('axis', [(0.0, 0.0, 1.0), (1.0, -2.0, 3.0)])
def test_the_papers_law_jumps_by_twice_its_first_torque_and_nowhere_else(
    axis: tuple[float, float, float], paper: AttitudeMpc,
) -> None:
    study = study_axis(paper, axis, 20.0)
    assert len(study.jumps) == 1
    jump = study.side_jump
    assert jump is not None
    assert jump.at_deg == pytest.approx(180.0, abs=1e-3)
    assert jump.size_n_m == pytest.approx(2 * FIRST_TORQUE, abs=2e-4)
    assert np.allclose(jump.below_n_m, -FIRST_TORQUE * study.axis, atol=2e-4)
    assert np.allclose(jump.above_n_m, FIRST_TORQUE * study.axis, atol=2e-4)
    # It does not shrink over nine decades of the interval, where the law elsewhere halves.
    assert jump.widths_deg[0] / jump.widths_deg[-1] > 1e8
    assert np.ptp(jump.differences_n_m) < 0.01
    rates = study.smooth_differences_n_m / study.smooth_widths_deg
    assert np.allclose(rates[:8], rates[0], rtol=1e-2)
    assert study.steepest_elsewhere < 0.01
    # The cost is continuous there: both sides cost the same.
    assert study.jump_costs[0] == pytest.approx(27.9284, abs=1e-3)
    assert study.jump_costs[0] > study.cost.max()


def test_the_jump_is_the_same_about_an_axis_and_its_opposite(paper: AttitudeMpc) -> None:
    body = np.diag([1.0, 0.9, 0.6])
    uneven = AttitudeMpc(replace(
        paper.config, inertia_kg_m2=body, rate_weight=np.trace(body) / 2 * np.eye(3) - body),
        backend='c')
    axes = np.array([[1.0, -2.0, 3.0], [0.0, 0.0, 1.0]])
    there, opposite = (map_jumps(uneven, sign * axes, 5.0) for sign in (1, -1))
    assert np.allclose(there.jump_n_m, opposite.jump_n_m, atol=1e-3)
    assert np.allclose(there.at_deg, 360.0 - opposite.at_deg, atol=0.01)
    # Twice 1.1051 N m about the principal axis z, at 180 degrees (design page, trap 1); about an
    # axis that is not principal the two sides are not alike and the jump is beside 180 degrees.
    assert there.jump_n_m[1] == pytest.approx(2 * 1.1051, abs=1e-3)
    assert there.at_deg[1] == pytest.approx(180.0, abs=0.011)
    assert abs(there.at_deg[0] - 180.0) > 0.02


class OneSided:
    """A law that turns every attitude the same way."""

    torque_B_n_m, cost, config = np.array([0.1, 0.2, -0.3]), 1.0, paper_config()

    def reset(self) -> None:
        pass

    def solve(self, R_NB: Array, omega_BN_B: Array) -> OneSided:
        assert R_NB.shape == (3, 3)
        assert not omega_BN_B.any()
        return self


def test_a_law_that_never_changes_sides_has_no_jump_to_report() -> None:
    axis = np.array([0.0, 0.0, 1.0])
    assert d.jump_of_side(OneSided(), axis, 20.0, 0.01) is None
    study = study_axis(OneSided(), axis, 20.0)
    assert study.jumps == ()
    assert study.side_jump is None
    assert np.isnan(map_jumps(OneSided(), axis[None, :], 20.0).jump_n_m).all()


@pytest.mark.parametrize('radius', [10.0, 1.0])
def test_the_pointing_law_winds_once_around_the_antipode(
    radius: float, pointing: AttitudeMpc,
) -> None:
    circle = study_circle(pointing, radius, samples=24)
    assert circle.winding == 1
    assert circle.jumps == ()
    assert circle.shows_discontinuity
    assert np.degrees(circle.largest_step_rad) == pytest.approx(15.0, abs=0.1)
    assert circle.least_across_n_m > 1.1
    # However small the circle, opposite sides of it turn opposite ways.
    assert circle.least_opposite_n_m == pytest.approx(2 * circle.least_across_n_m, rel=1e-3)
