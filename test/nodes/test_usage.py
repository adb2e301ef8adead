# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Command lines of the executables; no ROS needed."""

from __future__ import annotations

import subprocess
import sys

import pytest

from manifold_mpc_ros.nodes.controller import main as controller
from manifold_mpc_ros.nodes.guidance import main as guidance
from manifold_mpc_ros.nodes.markers import main as markers
from manifold_mpc_ros.nodes.simulator import main as simulator
from manifold_mpc_ros.nodes.usage import Program, parse_arguments

PROGRAMS = [controller.PROGRAM, guidance.PROGRAM, simulator.PROGRAM, markers.PROGRAM]


@pytest.mark.parametrize('program', PROGRAMS)
def test_help_names_every_parameter_with_its_unit(
    program: Program, capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as end:
        parse_arguments(program, ['--help'])
    assert end.value.code == 0
    text = capsys.readouterr().out
    for spec in program.parameters:
        assert (f'{spec.name} [{spec.unit}]' if spec.unit else spec.name) in text
    for name, kind, _meaning in (*program.subscribes, *program.publishes, *program.replies):
        assert name in text
        assert kind in text
    assert max(map(len, text.splitlines())) <= 100


@pytest.mark.parametrize('argv', [
    ['--foo'], ['foo'], ['--ros-args', '-p', 'a:=1', '--', '--foo'],
])
def test_an_unknown_argument_ends_with_2(argv: list[str]) -> None:
    with pytest.raises(SystemExit) as end:
        parse_arguments(controller.PROGRAM, argv)
    assert end.value.code == 2


def test_ros_arguments_pass_and_parameter_files_are_found() -> None:
    argv = ['--ros-args', '--params-file', 'a.yaml', '-r', 'x:=y', '--params-file', 'b.yaml', '--']
    arguments = parse_arguments(controller.PROGRAM, argv)
    assert arguments.ros == argv
    assert arguments.parameter_files == ['a.yaml', 'b.yaml']
    assert parse_arguments(controller.PROGRAM, []).parameter_files == []


@pytest.mark.parametrize('module', ['controller', 'simulator'])
def test_the_module_runs_and_knows_its_name(module: str) -> None:
    done = subprocess.run(
        [sys.executable, '-m', f'manifold_mpc_ros.nodes.{module}.main', '--unknown'],
        capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert f'{module}: error: unrecognized arguments: --unknown' in done.stderr


@pytest.mark.parametrize(('package', 'module', 'words', 'status'), [
    ('casadi', 'nodes.controller.main', (), 1), ('rclpy', 'nodes.markers.main', (), 1),
    ('casadi', 'cli.main', ('simulate',), 2)])
def test_a_package_that_is_missing_is_named_in_one_line(
    package: str, module: str, words: tuple[str, ...], status: int,
) -> None:
    pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
    run = (f'import sys; sys.modules[{package!r}] = None\n'
           f'from manifold_mpc_ros.{module} import main\nsys.exit(main({list(words)}))')
    done = subprocess.run([sys.executable, '-c', run],
                          capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout) == (status, '')
    assert f'{package} is not installed: ' in done.stderr
    assert 'pip install' in done.stderr
    assert done.stderr.count('\n') == 1
