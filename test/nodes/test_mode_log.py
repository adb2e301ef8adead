# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the log says of modes and refusals: every kind once, and never a flood."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY

from manifold_mpc_ros.control.input_gate import Reason, Refusal
from manifold_mpc_ros.nodes.mode_log import CHANGES_AT_ONCE, ERROR, WARN, ModeLog, RefusalLog

OK = 0


class Lines:
    """A logger that keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []

    def info(self, message: str) -> None:
        self.lines.append(('info', message))

    def warning(self, message: str) -> None:
        self.lines.append(('warning', message))

    def error(self, message: str) -> None:
        self.lines.append(('error', message))


class Log:
    """A log of modes whose time comes from the test."""

    def __init__(self) -> None:
        self.out, self.refusals, self.now_s = Lines(), RefusalLog(), 1000.0
        self.log = ModeLog(self.out, self.refusals, 'INACTIVE')

    def note(self, mode: str, level: int = OK, reason: str = 'why', after_s: float = 0.0) -> None:
        self.now_s += after_s
        self.log.note(mode, level, reason, self.now_s)

    def taken(self) -> list[tuple[str, str]]:
        """Return the lines since the last call."""
        lines, self.out.lines = self.out.lines, []
        return lines


def test_each_change_of_mode_has_a_line_with_its_reason_and_severity() -> None:
    log = Log()
    log.note('INACTIVE')
    assert log.taken() == []
    log.note('WAIT', WARN, 'no state')
    log.note('NOMINAL', OK, 'solved')
    log.note('NOMINAL', WARN, 'the value did not fall')  # the same mode, no error
    log.note('FAULT', ERROR, 'two publishers')
    log.note('HOLD', WARN, 'late')
    log.note('HOLD', ERROR, 'latched')
    assert log.taken() == [
        ('info', 'WAIT: no state'), ('info', 'NOMINAL: solved'),
        ('error', 'FAULT: two publishers'), ('warning', 'HOLD: late'), ('error', 'HOLD: latched')]


def test_a_mode_that_flutters_has_a_line_a_second_with_a_count_and_the_last_one_is_said() -> None:
    log = Log()
    for k in range(1000):
        log.note('HOLD' if k % 2 else 'NOMINAL', after_s=0.01)
    lines = log.taken()
    assert CHANGES_AT_ONCE <= len(lines) <= CHANGES_AT_ONCE + 10
    assert lines[-1][1].endswith(' changes of mode)')
    log.note('FAULT', ERROR, 'enough', after_s=0.01)
    log.note('FAULT', ERROR, 'enough', after_s=1.0)
    level, line = log.taken()[-1]
    assert (level, line.startswith('FAULT: enough')) == ('error', True)


def refuse(log: Log, reason: Reason, detail: str = 'what was wrong', times: int = 1) -> None:
    for _ in range(times):
        log.refusals.add('odometry', Refusal(reason, detail))


def test_each_kind_of_refused_input_is_said_once_and_then_less_and_less_often() -> None:
    log, said = Log(), []
    for _ in range(10_000):  # 100 bad messages a second
        refuse(log, Reason.NON_FINITE)
        log.note('INACTIVE', after_s=0.01)
        said += [log.now_s for _ in log.taken()]
    assert len(said) == 7
    assert min(b - a for a, b in itertools.pairwise(said)) >= 1.0 - 1e-9
    refuse(log, Reason.FUTURE, 'the stamp is 9.000 s ahead')  # another kind waits for no gap
    log.note('INACTIVE', after_s=1.0)
    (level, line), = log.taken()
    assert level == 'warning'
    assert '1 on odometry: the stamp is 9.000 s ahead' in line
    assert ' on odometry: what was wrong' in line


@PROPERTY
@given(kinds=st.lists(st.tuples(st.sampled_from(list(Reason)), st.floats(0.0, 3.0)), min_size=1,
                      max_size=40))
def test_refusals_are_counted_to_the_last_and_no_second_has_two_lines(
    kinds: list[tuple[Reason, float]],
) -> None:
    log, lines = Log(), []
    for reason, after_s in kinds:
        refuse(log, reason, reason.value)
        log.note('INACTIVE', after_s=after_s)
        lines += [(log.now_s, line) for _, line in log.taken()]
    log.note('INACTIVE', after_s=200.0)
    lines += [(log.now_s, line) for _, line in log.taken()]
    times = [now_s for now_s, _ in lines]
    assert all(b - a >= 1.0 for a, b in itertools.pairwise(times))
    told = sum(int(part.split(' on ')[0].removeprefix('refused '))
               for _, line in lines for part in line.split('; '))
    assert told == len(kinds)
    assert all(any(reason.value in line for _, line in lines) for reason, _ in kinds)


def test_refusals_are_counted_by_topic_and_reason() -> None:
    assert RefusalLog().latest == ''
    log = RefusalLog()
    log.add('odometry', Refusal(Reason.STALE, 'old'))
    log.add('odometry', Refusal(Reason.STALE, 'older'))
    log.add('imu', Refusal(Reason.FUTURE, 'early'))
    assert log.counts == {'odometry.stale': 2, 'imu.future': 1}
    assert log.latest == 'imu: early'
