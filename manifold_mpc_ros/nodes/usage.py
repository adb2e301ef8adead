# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an executable says about itself, and which arguments it takes. Needs no ROS."""

from __future__ import annotations

import argparse
import itertools
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from manifold_mpc_ros.config.interfaces import BOND, CLOCK, DESCRIPTION, Interfaces
from manifold_mpc_ros.config.parameter import ParameterSpec, Value

_WIDTH = 97


@dataclass(frozen=True)
class Program:
    """One executable: its names, its parameters, and the topics and services of its own.

    The help and the security policies (config/sros2) are made from it. What every lifecycle node
    of ROS has (transitions, parameters, /rosout) is not listed.
    """

    executable: str
    node_name: str
    summary: str
    parameters: tuple[ParameterSpec, ...]
    subscribes: Interfaces
    publishes: Interfaces
    replies: Interfaces

    @classmethod
    def managed(
        cls, executable: str, node_name: str, summary: str, parameters: tuple[ParameterSpec, ...],
        *, subscribes: Interfaces = (), publishes: Interfaces, diagnostics: str, reset: str,
        pause: str,
    ) -> Program:
        """Return the program of a `ManagedNode`, with what each has and what it means here."""
        return cls(
            executable, node_name, summary, parameters, (*subscribes, CLOCK, BOND),
            (*publishes, ('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', diagnostics),
             BOND, DESCRIPTION),
            (('~/reset', 'std_srvs/srv/Trigger', reset),
             ('~/pause', 'std_srvs/srv/SetBool', pause)))


@dataclass(frozen=True)
class Arguments:
    """The command line of an executable that was accepted."""

    ros: list[str]
    parameter_files: list[str]


def parse_arguments(program: Program, argv: Sequence[str]) -> Arguments:
    """Return the ROS arguments of ``argv``; print help (exit 0) or refuse the others (exit 2)."""
    ros, own = _split(argv)
    parser = argparse.ArgumentParser(
        prog=program.executable,
        usage=f'{program.executable} [--help] [--ros-args ...]',
        description=program.summary,
        epilog=_epilog(program),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.parse_args(own)
    files = [value for flag, value in itertools.pairwise(ros) if flag == '--params-file']
    return Arguments(list(argv), files)


def _split(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the arguments between ``--ros-args`` and ``--``, and all others."""
    ros: list[str] = []
    own: list[str] = []
    inside = False
    for argument in argv:
        if argument == '--ros-args':
            inside = True
        elif inside and argument == '--':
            inside = False
        else:
            (ros if inside else own).append(argument)
    return ros, own


def _epilog(program: Program) -> str:
    """Return the help below the options: how to set things, interfaces, parameters."""
    lines = [
        'ROS arguments (behind --ros-args):',
        '  --params-file FILE      parameters of this node; without it the shipped values apply',
        '  -p NAME:=VALUE          one parameter',
        '  -r FROM:=TO             remap a topic; -r __ns:=/NAMESPACE puts the node in one',
        '',
        f'node {program.node_name}, topics and services:',
    ]
    lines += _interfaces(program)
    lines += ['', 'parameters [unit] = shipped value (* a parameter file has to give it):']
    for spec in program.parameters:
        lines += _parameter(spec)
    return '\n'.join(lines)


def _interfaces(program: Program) -> list[str]:
    """Return one line of help on each topic and service."""
    return [f'  {name:<20} {kind:<37} {direction}{meaning}'
            for direction, interfaces in (('in: ', program.subscribes),
                                          ('out: ', program.publishes), ('', program.replies))
            for name, kind, meaning in interfaces]


def _parameter(spec: ParameterSpec) -> list[str]:
    """Return the lines of help on one parameter."""
    unit = f' [{spec.unit}]' if spec.unit else ''
    head = f'  {"*" if spec.required else " "} {spec.name}{unit} = {_text(spec.default)}'
    body = f'{spec.description}; {spec.valid}'
    indent = ' ' * 8
    return [*textwrap.wrap(head, _WIDTH, subsequent_indent=indent), *textwrap.wrap(
        body, _WIDTH, initial_indent=indent, subsequent_indent=indent)]


def _text(value: Value) -> str:
    """Return a value as it is written in YAML."""
    return str(value).lower() if isinstance(value, bool) else str(value)
