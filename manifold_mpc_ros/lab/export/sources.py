# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller of a configuration as plain C99, from the sources that Python compiles too."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.export.bounds import bounds_of
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc import cache, search
from manifold_mpc_ros.mpc.backends.code_generation import (
    controller_code,
    defines,
    number,
    parts_code,
    source,
)
from manifold_mpc_ros.mpc.program.layout import layout_of
from manifold_mpc_ros.mpc.program.numbers import numbers_beside, numbers_of
from manifold_mpc_ros.mpc.program.options import VIAS
from manifold_mpc_ros.mpc.program.phase import Field, Memory, Structure
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.stages.inequalities import cone_inequalities, structure_of
from manifold_mpc_ros.terminal.design import TerminalDesign

_TEMPLATES = Path(__file__).resolve().parent / 'templates'
# Doubles that interface.c keeps for its struct.
_STRUCT_DOUBLES = 96


def exported(config: AttitudeMpcConfig, terminal: TerminalDesign, *, moving: bool = False
             ) -> dict[str, str]:
    """Map a configuration and its terminal design to the files of the C controller, by name.

    ``moving``: with references. Raises ConfigurationError for those with steps that grow.
    """
    if moving and config.horizon_s:
        raise ConfigurationError('mpc.horizon_s', config.horizon_s,
                                 '0: targets that move need equal steps')
    structure = structure_of(config, disturbed=True, moving=moving)
    layout = layout_of(structure)
    fixed, node = _doubles(structure)
    rows = {f'{memory.name}_ROWS': str(layout.rows(memory)) for memory in Memory}
    numbers = numbers_of(config, terminal, structure)
    beside = numbers_beside(config, terminal, structure)
    key = cache.name_of(structure, sorted(rows.items()), sorted(beside))
    names = {name: f'numbers_of_{name}' for name in beside}
    code = '\n'.join([
        _guard(key), source('one_lane.h'), defines(structure), parts_code(structure, 'plant'),
        controller_code(structure),
        _filled('interface.c', {
            'STRUCT_DOUBLES': str(_STRUCT_DOUBLES),
            'SET_NUMBERS': _set_numbers(numbers, structure),
            'ARRAYS': ''.join(f'static const double {each}[] = MANIFOLD_MPC_{name.upper()};\n'
                              for name, each in names.items()),
            'POINT': '\n'.join(f'    c->{name} = {each};' for name, each in names.items())})])
    return {
        'manifold_mpc.h': _filled('manifold_mpc.h', rows | {
            'FIXED_DOUBLES': str(fixed), 'NODE_DOUBLES': str(node)}),
        'manifold_mpc.c': code,
        'manifold_mpc_data.h': _data(config, terminal, numbers, beside, key),
        **{name: _filled(name, {}) for name in ('example.c', 'Makefile', 'CMakeLists.txt')},
        'README.md': _filled('README.md', {
            **_facts(config, structure), **bounds_of(structure, config)})}


def _doubles(structure: Structure) -> tuple[int, int]:
    """Return the doubles of a controller's memory once, and of every node beside its stages."""
    ways = 2 * VIAS if cone_inequalities(structure) else 0
    return (_STRUCT_DOUBLES + layout_of(structure).rows(Memory.GLOBAL) + 6 + ways,
            15 + 12 * structure.moving)


def memory_doubles(config: AttitudeMpcConfig, structure: Structure) -> int:
    """Return what MANIFOLD_MPC_MEMORY_DOUBLES is."""
    layout, (fixed, node) = layout_of(structure), _doubles(structure)
    wheels = 0 if config.wheels is None else len(config.wheels)
    return (fixed + (config.horizon + 3) * (
        layout.rows(Memory.MODEL) + 5 * layout.rows(Memory.TRAJECTORY))
        + node * (config.horizon + 1) + 2 * wheels)


def _filled(name: str, values: dict[str, str]) -> str:
    """Return a template with each ``@NAME@`` replaced."""
    text = (_TEMPLATES / name).read_text(encoding='utf-8')
    for key, value in values.items():
        text = text.replace(f'@{key}@', value)
    return text


def _guard(key: str) -> str:
    """Return the lines that refuse the numbers of another structure."""
    return (
        '/* Copyright 2026 The manifold_mpc_ros authors\n * SPDX-License-Identifier: Apache-2.0\n'
        ' *\n * Written by `manifold-mpc export`; numbers are in manifold_mpc_data.h. */\n'
        '#include "manifold_mpc.h"\n\n'
        f'#ifndef MANIFOLD_MPC_FOR_{key}\n'
        '#error "manifold_mpc_data.h is of another kind of problem: export the code again"\n'
        '#endif\n')


def _name(field: Field) -> str:
    return f'MANIFOLD_MPC_{field.name.upper()}'


def _set_numbers(numbers: dict[Field, Array], structure: Structure) -> str:
    """Return the statements that put the numbers where the phases read them."""
    lines = []
    for field in numbers:
        small = field.name
        first = layout_of(structure).first_row(field)
        lines += [
            f'    static const double {small}[{field.size}] = {_name(field)};',
            f'    for (int i = 0; i < {field.size}; ++i)', f'        g[{first} + i] = {small}[i];']
    declared = [line for line in lines if 'static' in line]
    return '\n'.join([*declared, *(line for line in lines if 'static' not in line)])


def _braces(values: Iterable[float]) -> str:
    return '{' + ', '.join(number(value) for value in values) + '}'


def _data(config: AttitudeMpcConfig, terminal: TerminalDesign, numbers: dict[Field, Array],
          beside: dict[str, Array], key: str) -> str:
    """Return the numbers: the only file that changes with a parameter, but for kinds of limits."""
    unit = scaling_of(config)
    limit = [math.inf] * 3 if config.max_torque_n_m is None else config.max_torque_n_m
    starts = ', '.join(_braces(start) for start in search.starts(config).tolist())
    values = {
        'HORIZON': str(config.horizon), 'STEP_S': number(config.step_s),
        'UNITS': _braces([unit.time_s, unit.torque_n_m, unit.rate_rad_s, unit.cost]),
        'QUICKEST_RAD_S2': number(search.quickest_rad_s2(config)),
        'LINEAR_RAD': number(search.linear_rad(config)),
        'GUARD_SQUARED': number(search.guard_squared(config)),
        'TERMINAL_LEVEL': number(terminal.c), 'STARTS': f'{{{starts}}}',
        'MAX_TORQUE_N_M': _braces(limit), 'CONE_COUNT': str(len(config.cones)),
        'WHEEL_COUNT': str(0 if config.wheels is None else len(config.wheels)),
        'MOVING': str(int('follow' in beside)),
        **{name.upper(): _braces(each.tolist()) for name, each in beside.items()},
        **{field.name.upper(): _braces(each.tolist()) for field, each in numbers.items()}}
    lines = [f'#define MANIFOLD_MPC_{name} {_wrapped(value)}' for name, value in values.items()]
    return '\n'.join([
        '/* Copyright 2026 The manifold_mpc_ros authors\n'
        ' * SPDX-License-Identifier: Apache-2.0\n *\n'
        ' * The numbers of one configuration; manifold_mpc.c is the same for its kind. */',
        '#ifndef MANIFOLD_MPC_DATA_H', '#define MANIFOLD_MPC_DATA_H', '',
        f'#define MANIFOLD_MPC_FOR_{key}', *lines, '', '#endif', ''])


def _wrapped(text: str) -> str:
    """Return a list of numbers in lines of a bearable length, as the preprocessor wants them."""
    lines, line = [], ''
    for word in text.split(' '):
        if len(line) + len(word) > 80:
            lines.append(line)
            line = ''
        line += word + ' '
    return ' \\\n    '.join([*lines, line]).rstrip()


def _facts(config: AttitudeMpcConfig, structure: Structure) -> dict[str, str]:
    """Return what the README says of a configuration."""
    doubles = memory_doubles(config, structure)
    limits = ', '.join(name.replace('_', ' ') for name, _ in structure.rows) or 'none'
    return {'TARGET': config.target, 'FORCING': config.forcing, 'LIMITS': limits,
            'STEP': f'{config.step_s:g}', 'HORIZON': str(config.horizon),
            'DOUBLES': f'{doubles:,}', 'KIB': f'{math.ceil(8 * doubles / 1024):,}'}
