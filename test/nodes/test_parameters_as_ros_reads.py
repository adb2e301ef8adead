# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reader of parameter files against a bare rclpy node: the same values, the same refusals."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY

from manifold_mpc_ros.cli.processes import reserved_domain
from manifold_mpc_ros.config.ros_parser import parse_ros_parameters
from manifold_mpc_ros.config.yaml_file import applies
from manifold_mpc_ros.errors import ConfigurationError

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from harness import child_environment

# Thousands of nodes start, one after the other.
pytestmark = pytest.mark.timeout(1500)
FULL_NAME = '/sat1/attitude_controller'
Given = list[list[str]] | None
Oracle = Callable[[str], Given]

WORDS = [
    'y', 'Y', 'yes', 'n', 'N', 'no', 'on', 'off', 'On', 'OFF', 'oN', 'True', 'tRUE', '.inf',
    '-.inf', '+.inf', '.Inf', '.iNF', '.nan', '-.nan', '+.nan', 'nan', 'NAN', 'nan(abc)',
    'nan(a-b)', 'inf', '-inf', '+inf', 'INFINITY', 'infinit', '0', '-0', '+0', '00', '010', '08',
    '-010', '+5', '0x', '0x1F', '-0x10', '0x1.8p3', '0x1p-1074', '0x1p-1075', '0x1.8p-1074',
    '0x1p1024', '0x.8', '0x1.', '0x.p1', '9223372036854775807', '9223372036854775808',
    '-9223372036854775808', '-9223372036854775809', '0x8000000000000000',
    '0777777777777777777777', '01777777777777777777777', '1e400', '-1e400', '1e-400', '5e-324',
    '4.9406564584124654e-324', '1e-320', '2.2250738585072011e-308', '2.2250738585072012e-308',
    '2.2250738585072014e-308', '1.7976931348623157e308', '1.7976931348623159e308',
    '0e99999999999', '1e99999999999', '1e-99999999999', '0.0e-400', '1.', '.5', '.', '+.', '-.5',
    '5.e3', '1e', '1e+', '1E5', '1_0', '2024-01-01', '~', 'null', 'Null', '=', '<<', '0b101',
    '0o17', '1d5', '1.0f', '1L', '--1', '+-1', '-', '1.2.3', 'nan()', 'infinity1',
]
WORDS += ['1' * 30, '1' * 5000, '0' * 5000 + '7', '0.' + '0' * 320 + '1', '0x' + 'f' * 300,
          '1' + '0' * 400 + 'e-300', '0' * 40 + '1']

numbers_and_nearly = st.text('0123456789.eE+-xXpPinfaNFby_', min_size=1, max_size=8)
scalars = st.sampled_from(WORDS) | numbers_and_nearly | st.floats().map(repr) | (
    st.integers(-2**65, 2**65).map(str))
STYLES = ('{}', '"{}"', "'{}'", '|-\n      {}', '|\n      {}', '|2-\n        {}', '!!str {}',
          '!!float {}', '! {}', '[{}]', '[[{}]]', '[{0}, {0}]', '&anchor {}')

leaves = st.sampled_from([
    '1', '0.5', 'yes', 'x', '"a"', "''", 'null', '~', '[]', '[1, 2]', '[1.0, 2]', '[a, b]',
    '[yes, 1]', '[[1.0, 2.0]]', '[[1], [2]]', '[{a: 1}]', '{}', '2024-01-01', '&b 3', '*b', '""',
    '!!str 5'])
keys = st.sampled_from(['a', 'b', 'c', 'a.b', 'a.c', '.d'])


def in_braces(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    """Draw a group, written in one line."""
    entry = st.tuples(keys, inner).map(': '.join)
    return st.lists(entry, min_size=1, max_size=4).map(lambda made: '{' + ', '.join(made) + '}')


groups = in_braces(st.recursive(leaves, in_braces, max_leaves=5))
sections = st.tuples(
    st.sampled_from([
        '/**', '**', '/*', '*', '/*/*', '/*/attitude_controller', '/**/attitude_controller',
        '/sat1/attitude_controller', 'sat1/attitude_controller', '/sat1/*', '/sat1/**', 'sat1',
        'attitude_controller', '1x', 'a/b', 'a//b', '/', 'other']),
    st.sampled_from([
        '{{ros__parameters: {}}}', '{{ros__parameters: {}}}', '{{ros__parameters_: {}}}',
        '{{attitude_controller: {{ros__parameters: {}}}}}', '{}',
        '{{n/m: {{ros__parameters: {0}}}, attitude_controller: {{ros__parameters: {0}}}}}']),
    groups | st.just('3'),
).map(lambda parts: f'{parts[0]}: {parts[1].format(parts[2])}')
pieces = st.sampled_from([
    'a', 'b: ', 'c: ', '{', '}', '[', ']', ', ', '\n', '\n  ', '\n    ', '- ', 'ros__parameters:',
    'attitude_controller:', '/**:', '"q"', "''", '1', '0.5', 'yes', '&z ', '*z', '!!str ', '|',
    '#', '---\n', '? ', ': ', '~', '<<: '])


@pytest.fixture(scope='module')
def oracle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Oracle]:
    """Give ``ask(text)``: the parameters that a bare node gets from a file, None: refused."""
    path = tmp_path_factory.mktemp('oracle') / 'parameters.yaml'
    with reserved_domain() as domain, subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name('parameter_oracle.py')), FULL_NAME],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env=child_environment(domain),
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None

        def ask(text: str) -> Given:
            path.write_text(text, encoding='utf-8')
            process.stdin.write(f'{path}\n')
            process.stdin.flush()
            return json.loads(process.stdout.readline())

        yield ask


def ours(text: str) -> Given:
    """Return what the package's reader gives to the same node."""
    found: dict[str, str] = {}
    try:
        for section, values in parse_ros_parameters(text, 'a file'):
            if applies(section, FULL_NAME):
                found.update({name: repr(value) for name, value in values.items()})
    except ConfigurationError:
        return None
    return [list(pair) for pair in found.items()]


@pytest.mark.parametrize('style', STYLES)
def test_every_odd_scalar(oracle: Oracle, style: str) -> None:
    """All in one file: what is no value for one of them would refuse them all."""
    head = '/**:\n  ros__parameters:\n'
    lines = [f'    k: {style.format(word)}\n' for word in WORDS]
    good = [line.replace('k:', f'k{index}:') for index, line in enumerate(lines)
            if ours(head + line) is not None]
    assert len(good) > 0.9 * len(WORDS)
    text = head + ''.join(good)
    given_by_ros = oracle(text)
    assert given_by_ros is not None
    assert ours(text) == given_by_ros


@PROPERTY
@given(drawn=st.lists(st.tuples(st.sampled_from(STYLES), scalars), min_size=1, max_size=8))
def test_scalars(oracle: Oracle, drawn: list[tuple[str, str]]) -> None:
    text = '/**:\n  ros__parameters:\n' + ''.join(
        f'    k{index}: {style.format(scalar)}\n' for index, (style, scalar) in enumerate(drawn))
    assert ours(text) == oracle(text)


@PROPERTY
@given(drawn=st.lists(sections, min_size=1, max_size=4))
def test_sections_groups_and_lists(oracle: Oracle, drawn: list[str]) -> None:
    text = '\n'.join(drawn) + '\n'
    assert ours(text) == oracle(text)


@PROPERTY
@given(
    head=st.sampled_from(['', '/**:\n  ros__parameters:\n    a: ', '/**: {ros__parameters: {a: ']),
    drawn=st.lists(pieces, max_size=10))
def test_anything(oracle: Oracle, head: str, drawn: list[str]) -> None:
    text = head + ''.join(drawn)
    assert ours(text) == oracle(text)
