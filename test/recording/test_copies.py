# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of a golden bag keep its verdict, in every form that ros2 bag makes."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from copies import copies, others
from golden import GOLDEN
from synthetic import run_messages, write_bag

from manifold_mpc_ros.lab.recording.bags.contents import END_TOPIC
from manifold_mpc_ros.lab.recording.bags.reader import read_bag
from manifold_mpc_ros.lab.recording.bags.run import read_run
from manifold_mpc_ros.lab.recording.bags.verdict import Verdict, judge


def said(verdict: Verdict) -> list[tuple[str, str, bool]]:
    return [(each.name, each.measured, each.passed) for each in verdict.judgements]


@pytest.mark.parametrize('name', ['half_turn', 'mistuned', 'pointing'])
def test_copies_of_a_golden_bag_keep_its_verdict(tmp_path: Path, name: str) -> None:
    verdict = judge(read_run(GOLDEN / f'{name}.mcap'))
    assert verdict.passed is (name != 'mistuned')
    for form, path in copies(tmp_path, GOLDEN / f'{name}.mcap'):
        assert said(judge(read_run(path))) == said(verdict), form


def test_a_copy_without_its_end_has_not_passed(tmp_path: Path) -> None:
    contents = read_bag(GOLDEN / 'half_turn.mcap')
    kinds = {topic.name: topic.kind for topic in contents.topics.values()}
    kept = [each for each in contents.messages if each.topic != END_TOPIC]
    assert judge(read_run(others(tmp_path / 'copy', [kept], kinds))).failed == ('recording',)


def test_files_are_named_as_rosbag2_names_them(tmp_path: Path) -> None:
    """``ros2 bag reindex`` looks for names that end in a number."""
    for storage, suffix in (('mcap', 'mcap'), ('sqlite3', 'db3')):
        bag = write_bag(tmp_path / f'my.{storage}', run_messages(3), storage)
        names = sorted(file.name for file in bag.iterdir())
        assert names == ['metadata.yaml', f'my.{storage}_0.{suffix}']
        document = yaml.safe_load((bag / 'metadata.yaml').read_text(encoding='utf-8'))
        assert document['rosbag2_bagfile_information']['relative_file_paths'] == names[1:]
