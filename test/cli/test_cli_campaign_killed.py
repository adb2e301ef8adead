# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A campaign of real processes that is killed or interrupted: nothing lost, nothing repeated."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml
from campaign_plans import mapping, plants
from interruptible import take_interrupts

Command = Callable[..., tuple[int, str, str]]
TOP = Path(__file__).parents[2]
LOOPS, START_LIMIT_S = 24, 120.0


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """A campaign of a few seconds with the optimiser, on the model and on plants."""
    path = tmp_path / 'small.yaml'
    path.write_text(yaml.safe_dump(mapping(
        duration_s=5.0, acceptance={}, sets=[mapping()['sets'][0], plants()])), encoding='utf-8')
    return path


@contextmanager
def running(campaign: Path, output: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run the command as a process group of its own, which is gone at the end."""
    path = os.pathsep.join([str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])
    process = subprocess.Popen(
        [sys.executable, '-m', 'manifold_mpc_ros.cli.main', 'campaign', str(campaign),
         '--workers', '2', '-o', str(output), *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=take_interrupts, env=dict(os.environ, PYTHONPATH=path))
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def recorded(output: Path) -> list[str]:
    """Return the names of the cases in the record, as often as they are in it."""
    journal = output / 'loops.jsonl'
    lines = journal.read_text().splitlines(keepends=True)[1:] if journal.is_file() else []
    return [outcome['name'] for line in lines if line.endswith('\n')
            for outcome in json.loads(line[9:])]


def wait(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + START_LIMIT_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_killed_twice_and_resumed_it_is_the_same_campaign(
    command: Command, campaign: Path, tmp_path: Path,
) -> None:
    """SIGKILL to all of its processes in mid-run; the table has the bits of a quiet run."""
    loops, output = ('--loops', str(LOOPS)), tmp_path / 'killed'
    for _ in range(2):
        before = len(recorded(output))
        with running(campaign, output, *loops) as process:
            wait(lambda before=before: len(recorded(output)) > before)  # type: ignore[misc]
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        assert before < len(recorded(output)) < 2 * LOOPS
    done = len(recorded(output))
    status, out, err = command('campaign', campaign, '--workers', '1', '-o', output, *loops)
    assert f'{done} of {2 * LOOPS} loops are in' in out, err
    names = recorded(output)
    assert len(names) == len(set(names)) == 2 * LOOPS
    quiet, _, _ = command('campaign', campaign, '--workers', '1', '-o', tmp_path / 'quiet', *loops)
    assert quiet == status
    assert ((output / 'loops.parquet').read_bytes()
            == (tmp_path / 'quiet' / 'loops.parquet').read_bytes())


def ends_soon(group: int) -> bool:
    """Return whether nothing of a process group is left: a worker ends just after its parent."""
    end = time.monotonic() + 10.0
    while time.monotonic() < end:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.02)
    return False


def test_ctrl_c_ends_all_processes_without_a_traceback(campaign: Path, tmp_path: Path) -> None:
    """At the terminal every process of the group gets the signal, starting workers too."""
    with running(campaign, tmp_path / 'out', '--loops', '5000') as process:
        assert process.stdout is not None
        assert process.stdout.readline() == '10000 loops, 2 process(es)\n'
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=240)
    assert process.returncode == 130, (out[-2000:], err)
    assert 'Interrupted' in out
    assert err == ''
    assert ends_soon(process.pid)
