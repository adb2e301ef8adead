# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a campaign finds does not depend on how its work was shared; failures are said once."""

from __future__ import annotations

import multiprocessing
from typing import Any

import campaign_stubs as stubs
import pytest

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.sim import campaign_workers
from manifold_mpc_ros.sim.campaign import OPPOSITE, RANDOM, CampaignSettings, CaseName
from manifold_mpc_ros.sim.campaign_workers import CampaignError, Work, run_cases

CONFIG = AttitudeMpcConfig(
    inertia_kg_m2=(1.0, 0.9, 0.6), step_s=0.5, horizon=6, attitude_weight=(1, 1, 1),
    rate_weight=(0.25, 0.35, 0.65), torque_weight=(2, 2, 2))
NAMES = [CaseName(kind, index) for kind in (RANDOM, OPPOSITE) for index in range(3)]


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign_workers, 'CHUNK', 2)


def work(make: Any = campaign_workers.build_controller) -> Work:
    return Work(CONFIG, CampaignSettings(steps=12), 'vm', make)


def records(of: Work, workers: int) -> dict[str, dict[str, Any]]:
    return {o.name: o.record() for chunk in run_cases(of, NAMES, workers) for o in chunk}


def test_the_result_does_not_depend_on_the_number_of_workers() -> None:
    alone = records(work(), 1)
    assert set(alone) == set(map(str, NAMES))
    assert records(work(), 2) == alone
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize('workers', [1, 2])
def test_an_error_names_its_case(workers: int) -> None:
    expected = r'case (random|opposite)-\d: ValueError: the third is too much'
    with pytest.raises(CampaignError, match=expected):
        list(run_cases(work(stubs.make_thrower), NAMES, workers))
    assert multiprocessing.active_children() == []


def test_a_worker_that_dies_is_said_in_one_line() -> None:
    with pytest.raises(ManifoldMpcError, match='worker process died') as caught:
        list(run_cases(work(stubs.make_dying), NAMES, 2))
    assert '\n' not in str(caught.value)
    assert multiprocessing.active_children() == []


def test_closing_early_ends_the_pool() -> None:
    chunks = run_cases(work(stubs.make_damping), NAMES * 50, 2)
    assert next(chunks)
    chunks.close()  # type: ignore[attr-defined]
    assert multiprocessing.active_children() == []
