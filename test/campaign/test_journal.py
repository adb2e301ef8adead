# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The record of a campaign keeps every bit, survives damage, and the table follows from it."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import campaign_stubs as stubs
import pyarrow.parquet as parquet
import pytest
from campaign_plans import mapping, plan, plants

from manifold_mpc_ros.lab.campaign.case import all_names
from manifold_mpc_ros.lab.campaign.chunks import CampaignError, Work, run_on_processes
from manifold_mpc_ros.lab.campaign.journal import JOURNAL, Journal
from manifold_mpc_ros.lab.campaign.outcome import Outcome
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.campaign.table import PLAN_KEY, write_table

PLAN = plan(*mapping()['sets'], plants())
SOFTWARE = {'code': 'abc', 'numpy': '2.0'}


@pytest.fixture(scope='module')
def outcomes() -> list[Outcome]:
    work = Work(PLAN, stubs.make_damping)
    return [o for chunk in run_on_processes(work, all_names(PLAN), 1) for o in chunk]


def written(folder: Path, outcomes: Sequence[Outcome], size: int = 2) -> Path:
    """Record outcomes in chunks, an interrupted process's way: without closing."""
    journal = Journal(folder, PLAN, SOFTWARE)
    for at in range(0, len(outcomes), size):
        journal.append(outcomes[at:at + size])
    journal._file.close()
    return folder / JOURNAL


def read(folder: Path) -> dict[str, Outcome]:
    with Journal(folder, PLAN, SOFTWARE) as journal:
        return journal.outcomes


def test_every_bit_comes_back(tmp_path: Path, outcomes: list[Outcome]) -> None:
    odd = [replace(outcomes[0], name='random-99', settled_s=None, largest_excess=math.inf,
                   final_angle_deg=5e-324, broken=('not settled', 'decrease')), *outcomes]
    written(tmp_path, odd)
    back = read(tmp_path)
    assert list(back.values()) == odd


@pytest.mark.parametrize('seed', range(8))
def test_a_torn_end_is_cut_off_and_the_rest_kept(
    tmp_path: Path, outcomes: list[Outcome], seed: int,
) -> None:
    """Whatever length a killed process leaves: complete lines count, and appending goes on."""
    path = written(tmp_path, outcomes)
    data = path.read_bytes()
    cut = random.Random(seed).randrange(len(data))
    path.write_bytes(data[:cut])
    kept = max(0, 2 * (data[:cut].count(b'\n') - 1))
    with Journal(tmp_path, PLAN, SOFTWARE) as journal:
        assert list(journal.outcomes.values()) == outcomes[:kept]
        journal.append(outcomes[kept:])
    assert list(read(tmp_path).values()) == outcomes


def test_a_damaged_line_is_left_out(tmp_path: Path, outcomes: list[Outcome]) -> None:
    path = written(tmp_path, outcomes)
    lines = path.read_bytes().splitlines(keepends=True)
    lines[2] = lines[2].replace(b'1', b'2', 1)
    path.write_bytes(b''.join(lines))
    assert list(read(tmp_path).values()) == outcomes[:2] + outcomes[4:]


def test_a_case_that_is_there_twice_counts_once(tmp_path: Path, outcomes: list[Outcome]) -> None:
    path = written(tmp_path, outcomes)
    data = path.read_bytes()
    path.write_bytes(data + data.splitlines(keepends=True)[1])
    assert list(read(tmp_path).values()) == outcomes


def test_more_loops_are_the_same_campaign(tmp_path: Path, outcomes: list[Outcome]) -> None:
    written(tmp_path, outcomes)
    with Journal(tmp_path, PLAN.with_loops('random', 50), SOFTWARE) as journal:
        assert len(journal.outcomes) == len(outcomes)
    assert CampaignPlan.from_yaml(tmp_path / 'campaign.yaml').sets[0].loops == 50


@pytest.mark.parametrize(('other', 'software', 'words'), [
    (replace(PLAN, seed=1), SOFTWARE, 'holds another campaign'),
    (PLAN, {**SOFTWARE, 'numpy': '2.1'}, 'numpy 2.0, now 2.1'),
])
def test_another_campaign_or_software_is_refused_unless_overwritten(
    tmp_path: Path, outcomes: list[Outcome], other: CampaignPlan, software: dict[str, str],
    words: str,
) -> None:
    written(tmp_path, outcomes)
    with pytest.raises(CampaignError, match=f'{words}.*--overwrite'):
        Journal(tmp_path, other, software)
    assert list(read(tmp_path).values()) == outcomes
    with Journal(tmp_path, other, software, overwrite=True) as journal:
        assert journal.outcomes == {}


def test_a_file_that_is_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / JOURNAL).write_text('notes of mine\n', encoding='utf-8')
    with pytest.raises(CampaignError, match='not the record of a campaign'):
        Journal(tmp_path, PLAN, SOFTWARE)
    assert (tmp_path / JOURNAL).read_text(encoding='utf-8') == 'notes of mine\n'


def test_two_processes_cannot_write_at_a_time(tmp_path: Path) -> None:
    with (Journal(tmp_path, PLAN, SOFTWARE),
          pytest.raises(CampaignError, match='another process is running')):
        Journal(tmp_path, PLAN, SOFTWARE, overwrite=True)
    read(tmp_path)


def test_the_table_has_every_figure_and_the_plan(tmp_path: Path, outcomes: list[Outcome]) -> None:
    odd = [*outcomes[:-1], replace(outcomes[-1], settled_s=None, largest_excess=math.nan)]
    path = write_table(PLAN, odd, tmp_path / 'loops.parquet')
    table = parquet.read_table(path)
    assert CampaignPlan.from_text(table.schema.metadata[PLAN_KEY].decode(), 'small') == PLAN
    rows: list[dict[str, Any]] = table.to_pylist()
    assert [f'{row["set"]}-{row["index"]}' for row in rows] == [o.name for o in odd]
    for row, outcome in zip(rows, odd, strict=True):
        assert row['settled_s'] == outcome.settled_s
        assert row['final_angle_deg'] == outcome.final_angle_deg
        assert row['inertia_xy_kg_m2'] == outcome.inertia_kg_m2[3]
        assert row['setpoint_w'] == outcome.setpoint_xyzw[3]
        assert tuple(row['broken']) == outcome.broken
        assert not {'cold_solve_s', 'warm_solves_s'} & set(row)
    assert math.isnan(rows[-1]['largest_excess'])
    assert not path.with_name('loops.parquet.part').exists()


def test_equal_outcomes_make_equal_files(tmp_path: Path, outcomes: list[Outcome]) -> None:
    one = write_table(PLAN, outcomes, tmp_path / 'one.parquet')
    timed = [replace(o, cold_solve_s=9.9, warm_solves_s=()) for o in outcomes]
    assert write_table(PLAN, timed, tmp_path / 'two.parquet').read_bytes() == one.read_bytes()
    other = [replace(outcomes[0], final_rate_rad_s=math.nextafter(
        outcomes[0].final_rate_rad_s, 1.0)), *outcomes[1:]]
    assert write_table(PLAN, other, tmp_path / 'two.parquet').read_bytes() != one.read_bytes()
