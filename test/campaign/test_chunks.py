# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a campaign finds does not depend on how its work was shared; failures are said once."""

from __future__ import annotations

import multiprocessing
from pathlib import Path
from typing import Any

import campaign_stubs as stubs
import pytest
from campaign_plans import mapping, plan, plants

from manifold_mpc_ros.lab.campaign import chunks
from manifold_mpc_ros.lab.campaign.case import all_names
from manifold_mpc_ros.lab.campaign.chunks import CampaignError, Work, run_on_processes
from manifold_mpc_ros.lab.workers import WorkerDiedError

PLAN = plan(*mapping()['sets'], plants(), duration_s=6.0)
NAMES = all_names(PLAN)


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, 'CHUNK', 2)


def work(make: Any = chunks.build_controller) -> Work:
    return Work(PLAN, make)


def records(of: Work, workers: int) -> dict[str, dict[str, Any]]:
    found = [o for chunk in run_on_processes(of, NAMES, workers) for o in chunk]
    assert len(found) == len(NAMES)
    return {o.name: o.record() for o in found}


def test_the_result_does_not_depend_on_the_number_of_workers() -> None:
    alone = records(work(), 1)
    assert set(alone) == set(map(str, NAMES))
    assert records(work(), 2) == alone
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize('workers', [1, 2])
def test_an_error_names_its_case(workers: int) -> None:
    expected = r'case (random|opposite|plants)-\d: ValueError: the third is too much'
    with pytest.raises(CampaignError, match=expected):
        list(run_on_processes(work(stubs.make_thrower), NAMES, workers))
    assert multiprocessing.active_children() == []


def test_a_worker_that_dies_is_replaced_and_its_cases_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    mark = tmp_path / 'died'
    monkeypatch.setenv('DYING_ONCE_MARK', str(mark))
    assert records(work(stubs.make_dying_once), 2) == records(work(stubs.make_damping), 1)
    assert mark.exists()


def test_workers_that_always_die_are_said_in_one_line() -> None:
    with pytest.raises(WorkerDiedError, match='worker process died') as caught:
        list(run_on_processes(work(stubs.make_dying), NAMES, 2))
    assert '\n' not in str(caught.value)
    assert multiprocessing.active_children() == []


def test_closing_early_ends_the_pool() -> None:
    iterator = run_on_processes(work(stubs.make_damping), NAMES * 50, 2)
    assert next(iterator)
    iterator.close()
    assert multiprocessing.active_children() == []
