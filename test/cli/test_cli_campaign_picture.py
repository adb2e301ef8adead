# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of a campaign is labelled, nothing overlaps, and what never settles is drawn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold_mpc_ros.sim.campaign import CampaignSettings
from manifold_mpc_ros.sim.campaign_outcome import Outcome
from matplotlib.figure import Figure
from test_cli_pictures import assert_no_text_overlaps

from manifold_mpc_ros.cli.plot_campaign import EXCESS_RANGE, plot_campaign
from manifold_mpc_ros.config import AttitudeMpcConfig

CONFIG: dict[str, Any] = {
    'inertia_kg_m2': (1.0, 0.9, 0.6), 'step_s': 0.5, 'horizon': 4, 'attitude_weight': (1, 1, 1),
    'rate_weight': (0.25, 0.35, 0.65), 'torque_weight': (2, 2, 2)}
GOOD = Outcome(
    'random-0', 100.0, 0.1, 11.0, 1e-6, 1e-9, 0, 0, 2e-13, 0, 0, 0, 0, 1, (0.3,) * 3, (0.6,) * 3,
    None, False, (), 1e-2, (1e-3,))
NEVER = replace(GOOD, settled_s=None, broken=('not settled', 'decrease'), largest_excess=0.3)


def outcomes(kind: str, count: int) -> list[Outcome]:
    rng = np.random.default_rng(count)
    return [replace(
        GOOD, name=f'{kind}-{index}', settled_s=0.5 * int(rng.integers(16, 28)),
        initial_angle_deg=180.0 if kind == 'opposite' else float(rng.uniform(0.0, 180.0)),
        largest_excess=float(rng.normal() * 1e-13)) for index in range(count)]


@pytest.mark.parametrize('found', [
    outcomes('random', 200) + outcomes('opposite', 40),
    outcomes('random', 3),
    outcomes('opposite', 1),
    [*outcomes('random', 30), replace(NEVER, name='random-99')],
    [replace(NEVER, largest_excess=float('nan'))],
])
@pytest.mark.parametrize('target', ['attitude', 'pointing'])
def test_labelled_and_nothing_overlaps(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, found: list[Outcome], target: str,
) -> None:
    figures: list[Figure] = []
    save = Figure.savefig

    def collect(figure: Figure, *arguments: Any, **options: Any) -> None:
        figures.append(figure)
        save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, 'savefig', collect)
    path = plot_campaign(AttitudeMpcConfig(**CONFIG, target=target), CampaignSettings(), found,
                         tmp_path / 'campaign.png')
    assert path.read_bytes().startswith(b'\x89PNG')
    (figure,) = figures
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
    plot_campaign(AttitudeMpcConfig(**CONFIG), CampaignSettings(), found, tmp_path / 'map.png')
    assert counted == [200, 40]
