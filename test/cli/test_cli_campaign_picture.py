# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of a campaign is labelled, nothing overlaps, and what never settles is drawn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign_plans import mapping, plan, plants
from matplotlib.figure import Figure
from test_cli_pictures import assert_no_text_overlaps

from manifold_mpc_ros.lab.campaign.outcome import Outcome
from manifold_mpc_ros.lab.campaign.output.plot_campaign import EXCESS_RANGE, plot_campaign
from manifold_mpc_ros.lab.campaign.output.plot_spread import plot_spread

GOOD = Outcome(
    name='random-0', initial_angle_deg=100.0, initial_rate_rad_s=0.1, settled_s=11.0,
    final_angle_deg=1e-6, final_rate_rad_s=1e-9, changes=0, decrease_violations=0,
    largest_excess=2e-13, infeasible=0, not_converged=0, feasibility_lost=0, limits_exceeded=0,
    searches=1, largest_torque_n_m=(0.3,) * 3, largest_rate_rad_s=(0.6,) * 3,
    roll_turned_deg=None, cones=0, way_crosses_a_cone=False, cone_violations=0,
    cone_violation_s=0.0, least_cone_margin_deg=None, lost=False, broken=(),
    initial_attitude_xyzw=(0.0, 0.0, 0.0, 1.0),
    initial_rate_B_rad_s=(0.1, 0.0, 0.0), setpoint_xyzw=(0.0, 0.0, 0.0, 1.0),
    inertia_kg_m2=(1.0, 0.9, 0.6, 0.0, 0.0, 0.0), disturbance_n_m=(0.0,) * 3,
    attitude_noise_std_rad=0.0, rate_noise_std_rad_s=0.0, noise_seed=1, cold_solve_s=1e-2,
    warm_solves_s=(1e-3,))
NEVER = replace(GOOD, settled_s=None, broken=('not settled', 'decrease'), largest_excess=0.3)


def outcomes(kind: str, count: int) -> list[Outcome]:
    rng = np.random.default_rng(count)
    return [replace(
        GOOD, name=f'{kind}-{index}', settled_s=0.5 * int(rng.integers(16, 28)),
        initial_angle_deg=180.0 if kind == 'opposite' else float(rng.uniform(0.0, 180.0)),
        largest_excess=float(rng.normal() * 1e-13)) for index in range(count)]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that are saved."""
    figures: list[Figure] = []
    save = Figure.savefig

    def collect(figure: Figure, *arguments: Any, **options: Any) -> None:
        figures.append(figure)
        save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, 'savefig', collect)
    return figures


@pytest.mark.parametrize('found', [
    outcomes('random', 200) + outcomes('opposite', 40),
    outcomes('random', 3),
    outcomes('opposite', 1),
    [*outcomes('random', 30), replace(NEVER, name='random-99')],
    [replace(NEVER, largest_excess=float('nan'))],
])
@pytest.mark.parametrize('target', ['attitude', 'pointing'])
def test_labelled_and_nothing_overlaps(
    drawn: list[Figure], tmp_path: Path, found: list[Outcome], target: str,
) -> None:
    path = plot_campaign(plan(controller={'target': target}), found, tmp_path / 'campaign.png')
    assert path.read_bytes().startswith(b'\x89PNG')
    (figure,) = drawn
    spread, histogram, decrease = figure.axes[:3]
    assert spread.get_ylabel() == histogram.get_xlabel() == 'settled at [s]'
    assert target in spread.get_xlabel()
    assert_no_text_overlaps(figure)
    assert ('never' in [text.get_text() for text in spread.texts]) == any(
        outcome.settled_s is None for outcome in found)
    for line in decrease.lines[:-1]:
        values = line.get_ydata()
        assert np.all((values >= EXCESS_RANGE[0]) & (values <= EXCESS_RANGE[1]))


def test_the_map_has_every_loop_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = outcomes('random', 200) + outcomes('opposite', 40)
    counted = []
    histogram2d = np.histogram2d

    def count(*arguments: Any) -> Any:
        counts = histogram2d(*arguments)
        counted.append(int(counts[0].sum()))
        return counts

    monkeypatch.setattr(np, 'histogram2d', count)
    plot_campaign(plan(), found, tmp_path / 'map.png')
    assert counted == [200, 40]


def test_six_sets_and_plants_fit(tmp_path: Path, drawn: list[Figure]) -> None:
    sets = [plants(name=f'set_{letter}') for letter in 'abcdef']
    found = [replace(o, largest_excess=0.1 * o.largest_excess * 1e13)
             for one in sets for o in outcomes(one['name'], 20)]
    plot_campaign(plan(*sets), found, tmp_path / 'campaign.png')
    assert_no_text_overlaps(drawn[0])


def test_the_spread_has_a_column_for_each_thing_that_varies(
    tmp_path: Path, drawn: list[Figure],
) -> None:
    rng = np.random.default_rng(1)
    found = [replace(o, inertia_kg_m2=(1.0, 0.9, 0.6 + 0.1 * rng.uniform(), 0.0, 0.0, 0.0),
                     disturbance_n_m=(float(rng.uniform()), 0.0, 0.0)) for o in outcomes(
                         'plants', 20)]
    found[3] = replace(found[3], settled_s=None)
    path = plot_spread(plan(mapping()['sets'][0], plants()), found, tmp_path / 'spread.png')
    assert path is not None
    (figure,) = drawn
    assert [axes.get_xlabel() for axes in figure.axes[2:]] == [
        'inertia apart from the model [%]', 'disturbance [N m]']
    assert_no_text_overlaps(figure)
    assert plot_spread(plan(), outcomes('random', 5), tmp_path / 'none.png') is None
