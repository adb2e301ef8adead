# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Help, versions, mistakes: what the command says, and the status that it ends with."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import manifold_mpc_ros
from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.cli import main as cli
from manifold_mpc_ros.cli.verbs import VERBS
from manifold_mpc_ros.errors import ConfigurationError

Command = Callable[..., tuple[int, str, str]]
TOP = Path(__file__).parents[2]


def assert_one_message(status: int, out: str, err: str, *words: str) -> None:
    assert status == 2
    assert out == ''
    assert err.count('\n') == 1
    assert err.startswith('manifold-mpc')
    assert 'error: ' in err
    for word in words:
        assert word in err


@pytest.mark.parametrize('verb', VERBS)
def test_each_verb_has_help_with_examples(command: Command, verb: str) -> None:
    status, out, err = command(verb, '--help')
    assert status == 0
    assert err == ''
    assert out.startswith(f'usage: manifold-mpc {verb}')
    assert re.search(rf'^  manifold-mpc {verb}\b', out.partition('examples:')[2], re.MULTILINE)


@pytest.mark.parametrize('verb', VERBS)
def test_the_examples_of_the_help_are_accepted(verb: str) -> None:
    examples = cli.module_of(verb).EXAMPLES
    lines = re.findall(r'^ *manifold-mpc (.*)$', examples, re.MULTILINE)
    assert lines
    for line in lines:
        assert cli.build_parser().parse_args(shlex.split(line)).verb == verb


def test_the_help_lists_every_verb_and_the_exit_statuses(command: Command) -> None:
    status, out, err = command('--help')
    assert (status, err) == (0, '')
    for verb in VERBS:
        assert re.search(rf'^    {verb}\s', out, re.MULTILINE)
    assert 'exit status:' in out


@pytest.mark.parametrize(('verb', 'package'), [
    (verb, package) for verb, row in VERBS.items() for package in row.packages])
def test_a_missing_package_is_named_with_its_extra(
    command: Command, monkeypatch: pytest.MonkeyPatch, verb: str, package: str,
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    required = {verb: ['no_such_file'] for verb in ('replay', 'check', 'report', 'tune')}
    required['export'] = ['--params', 'no_such_file', '--output', 'no_such_folder']
    assert_one_message(
        *command(verb, *required.get(verb, [])),
        f'{verb} needs {package}', "pip install 'manifold_mpc_ros[lab]'")


@pytest.mark.parametrize(('arguments', 'package', 'extra'), [
    (['demo'], 'rclpy', 'ros'),
    (['record', 'rest_to_rest_90'], 'rclpy', 'ros'),
    (['chaos'], 'rclpy', 'ros'),
    (['bench', '--tick'], 'rclpy', 'ros'),
    (['campaign'], 'pyarrow', 'campaign'),
    (['campaign', '--scheduler', 'tcp://127.0.0.1:9'], 'distributed', 'cluster'),
])
def test_a_package_of_another_extra_is_named(
    command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, arguments: list[str],
    package: str, extra: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, package, None)
    assert_one_message(
        *command(*arguments), f'{package}, which is not installed', f'manifold_mpc_ros[{extra}]')
    assert not any(path.is_file() for path in tmp_path.rglob('*') if path.suffix == '.parquet')


def test_version(command: Command) -> None:
    status, out, err = command('--version')
    assert (status, err) == (0, '')
    assert re.fullmatch(r'manifold-mpc (\d+\.\d+\.\d+|\(source tree, not installed\))\n', out)


@pytest.mark.parametrize(('arguments', 'words'), [
    ([], ['VERB']),
    (['fly'], ['fly', 'simulate']),
    (['simulate', '--speed', '3'], ['--speed']),
    (['simulate', '--duration', 'long'], ['--duration', "'long'", 'finite number']),
    (['simulate', '--duration', 'nan'], ['--duration', "'nan'"]),
    (['simulate', '--duration', '-1'], ['--duration', 'above 0']),
    (['simulate', '--backend', 'java'], ['--backend', 'java', 'c']),
    (['figures', '--duration', '0'], ['--duration', 'above 0']),
    (['demo', '--time-limit', 'inf'], ['--time-limit', "'inf'"]),
])
def test_a_mistake_in_the_command_is_one_line(
    command: Command, arguments: list[str], words: list[str],
) -> None:
    assert_one_message(*command(*arguments), *words, '--help')


@pytest.mark.parametrize(('verb', 'option'), [
    ('simulate', '--controller-config'), ('simulate', '--simulator-config'),
    ('design', '--controller-config'), ('demo', '--controller-config'),
    ('demo', '--simulator-config'),
])
def test_a_missing_file_is_named(
    command: Command, verb: str, option: str, tmp_path: Path,
) -> None:
    assert_one_message(*command(verb, option, tmp_path / 'nowhere.yaml'), 'nowhere.yaml')


@pytest.mark.parametrize(('text', 'word'), [
    ('{unclosed: [1, 2', 'ROS'), ('just words', 'attitude_controller'),
    ('', 'attitude_controller'),
    ('/**/other:\n  ros__parameters: {}\n', 'attitude_controller'),
])
@pytest.mark.parametrize('verb', ['simulate', 'design', 'demo'])
def test_a_bad_file_is_named(
    command: Command, verb: str, text: str, word: str, tmp_path: Path,
) -> None:
    path = tmp_path / 'bad.yaml'
    path.write_text(text, encoding='utf-8')
    assert_one_message(*command(verb, '--controller-config', path), 'bad.yaml', word)


@pytest.mark.parametrize(('name', 'value', 'words'), [
    ('mpc.horizon', 0, ['mpc.horizon', '0']),
    ('spacecraft.inertia_kg_m2', [1.0, 1.0, 3.0], ['spacecraft.inertia_kg_m2']),
    ('mpc.terminal_scale', 1.5, ['mpc.terminal_scale', '1.5']),
    ('mpc.step_s', float('nan'), ['mpc.step_s']),
    ('mpc.horison', 3, ['mpc.horison']),
])
def test_a_bad_value_is_named(
    command: Command, write_config: Callable[..., Path], name: str, value: object,
    words: list[str],
) -> None:
    path = write_config('controller', **{name: value})
    assert_one_message(*command('design', '--controller-config', path), *words)


def test_a_run_that_is_no_multiple_of_the_step_is_refused(
    command: Command, quick_controller: Path, tmp_path: Path,
) -> None:
    assert_one_message(*command(
        'simulate', '--controller-config', quick_controller, '--duration', '0.7',
        '--output', tmp_path), 'duration_s', '0.7')


def test_an_output_folder_that_is_a_file_is_named(command: Command, tmp_path: Path) -> None:
    (tmp_path / 'taken').write_text('')
    status, _, err = command('figures', '--output', tmp_path / 'taken')
    assert status == 2
    assert err.count('\n') == 1
    assert 'taken' in err


def test_as_a_process_a_mistake_leaves_no_traceback() -> None:
    done = subprocess.run(
        [sys.executable, '-m', 'manifold_mpc_ros.cli.main', 'design', '--controller-config',
         'nowhere.yaml'], text=True, capture_output=True, check=False,
        env=dict(os.environ, PYTHONPATH=str(TOP)))
    assert_one_message(done.returncode, done.stdout, done.stderr, 'nowhere.yaml')


def test_an_interrupt_is_not_a_success(
    command: Command, monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(_arguments: object) -> int:
        raise KeyboardInterrupt
    monkeypatch.setattr('manifold_mpc_ros.lab.domain.verb_design.run', interrupted)
    assert command('design') == (130, '', 'manifold-mpc: interrupted\n')


def test_shipped_files_are_found_in_the_source_tree() -> None:
    for name in ('controller.yaml', 'simulator.yaml'):
        assert shared.shipped_config(name) == TOP / 'config' / name


def test_shipped_files_are_found_in_an_install_prefix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    package = tmp_path / 'prefix/lib/python3/site-packages/manifold_mpc_ros'
    share = tmp_path / 'prefix/share/manifold_mpc_ros/config'
    elsewhere = tmp_path / 'workspace/share/manifold_mpc_ros/config'
    for folder in (package, share, elsewhere):
        folder.mkdir(parents=True)
    monkeypatch.setattr(manifold_mpc_ros, '__path__', [str(package)])
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path / "workspace"}')
    with pytest.raises(ConfigurationError, match=r'controller\.yaml'):
        shared.shipped_config('controller.yaml')
    (elsewhere / 'controller.yaml').write_text('')
    assert shared.shipped_config('controller.yaml') == elsewhere / 'controller.yaml'
    (share / 'controller.yaml').write_text('')
    assert shared.shipped_config('controller.yaml') == share / 'controller.yaml'
