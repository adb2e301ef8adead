# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the first hour, followed: its files written, its commands run, in its order."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from manifold_mpc_ros.lab.recording.bags.run import read_run
from manifold_mpc_ros.lab.recording.bags.verdict import judge

Command = Callable[..., tuple[int, str, str]]

PAGE = (Path(__file__).parents[2] / 'docs/first_hour.md').read_text(encoding='utf-8')
#: In the order of the page: files, named by the text before them, and commands.
STEPS = re.findall(r'`(\w+\.yaml)`[^`]*?:\n\n```yaml\n(.*?)```|```sh\n(.*?)```', PAGE, re.DOTALL)


def test_the_page_ends_with_a_settled_bag_and_a_report(
        command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('rclpy')
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    verbs = []
    for name, text, commands in STEPS:
        if name:
            Path(name).write_text(text, encoding='utf-8')
        for line in commands.splitlines():
            program, *arguments = shlex.split(line)
            assert program == 'manifold-mpc'
            status, out, err = command(*arguments)
            assert (status, err) == (0, ''), f'{line}\n{out}'
            verbs.append(arguments[0])
    assert verbs == ['tune', 'design', 'simulate', 'record', 'check', 'report']
    run = read_run(tmp_path / 'slew')
    assert judge(run).passed
    assert run.scenario is not None
    assert run.scenario.controller_config.mpc.inertia_kg_m2[0, 0] == 0.13
    assert run.scenario.simulator_config.inertia_kg_m2[0, 0] == 0.13
    assert (tmp_path / 'report/slew.html').stat().st_size > 1e6
