# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The phases as C: each expression printed once, its loop over stages in vector lanes or serial.

Stages lie in blocks of ``LANES``; within a block every row of every field holds one number per
lane, so a phase whose stages are independent handles a block per iteration with one vector load
per row. The expression is CasADi's instruction list, one C statement per instruction: the same
sequence of roundings with any compiler and any number of lanes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import casadi as ca

from manifold_mpc_ros.mpc.program import fields, options
from manifold_mpc_ros.mpc.program.layout import Layout, layout_of
from manifold_mpc_ros.mpc.program.phase import Memory, Order, Phase, Ref, Structure
from manifold_mpc_ros.mpc.program.program import program_of
from manifold_mpc_ros.mpc.reference import LEAST_SHARE
from manifold_mpc_ros.mpc.scaling import POINTING_AXIS, TERMINAL_LEVEL
from manifold_mpc_ros.mpc.stages.cone import AIM
from manifold_mpc_ros.mpc.stages.inequalities import (
    cone_inequalities,
    node_inequalities,
    rate_inequalities,
    terminal_level,
    wheel_inequalities,
)
from manifold_mpc_ros.mpc.stages.reference import REFERENCE
from manifold_mpc_ros.terminal.cone_cut import LEAST_PART
from manifold_mpc_ros.terminal.level import SAFETY

_BINARY = {
    ca.OP_ADD: '{} + {}', ca.OP_SUB: '{} - {}', ca.OP_MUL: '{} * {}', ca.OP_DIV: '{} / {}',
    ca.OP_LT: 'm_lt({}, {})', ca.OP_LE: 'm_le({}, {})', ca.OP_EQ: 'm_eq({}, {})',
    ca.OP_NE: 'm_ne({}, {})', ca.OP_AND: 'm_and({}, {})', ca.OP_OR: 'm_or({}, {})',
    ca.OP_FMIN: 'm_min({}, {})', ca.OP_FMAX: 'm_max({}, {})',
    ca.OP_IF_ELSE_ZERO: 'm_if({}, {})', ca.OP_ATAN2: 'atan2({}, {})'}
_UNARY = {
    ca.OP_ASSIGN: '{}', ca.OP_NEG: '-{}', ca.OP_SQ: '{0} * {0}', ca.OP_TWICE: '{0} + {0}',
    ca.OP_INV: '1.0 / {}', ca.OP_SQRT: 'm_sqrt({})', ca.OP_FABS: 'm_abs({})',
    ca.OP_SIGN: 'm_sign({})', ca.OP_NOT: 'm_not({})', ca.OP_LOG: 'log({})',
    ca.OP_SIN: 'sin({})', ca.OP_COS: 'cos({})'}


def number(value: float) -> str:
    """Return a number as C writes it, to the bit."""
    return repr(float(value)) if value == value and abs(value) != float('inf') else (
        'NAN' if value != value else ('INFINITY' if value > 0 else '-INFINITY'))


class _Printer:
    """Prints one phase."""

    def __init__(self, phase: Phase, layout: Layout) -> None:
        """Decide between lanes and one stage at a time."""
        self._phase, self._layout = phase, layout
        self._lanes = phase.order is Order.ALL and phase.last is None and phase.only is None
        self._type = 'lanes' if self._lanes else 'double'

    def text(self) -> str:
        """Return the C function."""
        function = self._phase.function
        registers = range(function.sz_w())
        lines = [f'static void phase_{self._phase.name}(const double *restrict plan, '
                 'double *restrict fresh, double *restrict model, double *restrict g, long n)',
                 '{', f'    {self._loop()}']
        if registers:
            lines.append(f'        {self._type} ' + ', '.join(f'w{i}' for i in registers) + ';')
        lines += [f'        {line}' for line in self._body(function)]
        unused = ' '.join(f'(void){name};' for name in ('plan', 'fresh', 'model', 'g', 'n'))
        return '\n'.join([*lines, '    }', f'    {unused}', '}', ''])

    def _loop(self) -> str:
        phase = self._phase
        end = f'n + ({phase.beyond})' if phase.only is None else str(phase.only)
        if self._lanes:
            return f'for (long k = 0; k < {end}; k += LANES) {{'
        begin = '0' if self._phase.last is None else f'{end} - {self._phase.last}'
        if self._phase.order is Order.BACKWARD:
            return f'for (long k = {end} - 1; k >= {begin}; --k) {{'
        return f'for (long k = {begin}; k < {end}; ++k) {{'

    def _body(self, function: ca.Function) -> Iterable[str]:
        for i in range(function.n_instructions()):
            operation = function.instruction_id(i)
            inputs, outputs = function.instruction_input(i), function.instruction_output(i)
            if operation == ca.OP_INPUT:
                value = self._load(self._phase.reads[inputs[0]], inputs[1])
            elif operation == ca.OP_OUTPUT:
                yield self._store(self._phase.writes[outputs[0]], outputs[1], f'w{inputs[0]}')
                continue
            elif operation == ca.OP_CONST:
                value = self._constant(function.instruction_constant(i))
            elif operation in _BINARY:
                value = _BINARY[operation].format(*(f'w{j}' for j in inputs))
            else:
                value = _UNARY[operation].format(f'w{inputs[0]}')
            yield f'w{outputs[0]} = {value};'

    def _constant(self, value: float) -> str:
        text = number(value)
        return f'splat({text})' if self._lanes else text

    def _place(self, ref: Ref, entry: int) -> tuple[str, int, int]:
        """Return (memory's name in C, rows per stage, row) of one entry of a reference."""
        row = self._layout.first_row(ref.field) + entry
        if ref.field.memory is Memory.GLOBAL:
            return 'g', 1, row
        rows = self._layout.rows(ref.field.memory)
        if ref.field.memory is Memory.MODEL:
            return 'model', rows, row
        return ('fresh' if ref.new else 'plan'), rows, row

    def _load(self, ref: Ref, entry: int) -> str:
        memory, rows, row = self._place(ref, entry)
        if memory == 'g':
            return f'splat(g[{row}])' if self._lanes else f'g[{row}]'
        if not self._lanes:
            return f'{memory}[AT({rows}, {row}, k + ({ref.shift}))]'
        if ref.shift == 0:
            return f'*(const lanes *)({memory} + BLOCK({rows}, {row}, k))'
        side = {1: 'after', -1: 'before'}[ref.shift]
        return f'{side}({memory} + BLOCK({rows}, {row}, k), {rows} * LANES)'

    def _store(self, ref: Ref, entry: int, value: str) -> str:
        memory, rows, row = self._place(ref, entry)
        if memory == 'g':
            return f'g[{row}] = {value};'
        if not self._lanes:
            return f'{memory}[AT({rows}, {row}, k)] = {value};'
        return f'*(lanes *)({memory} + BLOCK({rows}, {row}, k)) = {value};'


def phase_code(phase: Phase, layout: Layout) -> str:
    """Return a phase as a static C function."""
    return _Printer(phase, layout).text()


def _part_code(name: str, phases: Iterable[Phase]) -> str:
    """Return a function that runs phases one after another."""
    calls = ''.join(f'    phase_{phase.name}(plan, fresh, model, g, n);\n' for phase in phases)
    return (f'static void run_{name}(const double *plan, double *fresh, double *model, '
            f'double *g, long n)\n{{\n{calls}}}\n')


def defines(structure: Structure) -> str:
    """Return the layout, the options and what the structure is, as preprocessor lines."""
    layout = layout_of(structure)
    named = [*layout.fields(Memory.GLOBAL), fields.LEAN, fields.INNER, fields.LATER, fields.POSE,
             fields.TORQUE, *((AIM,) if cone_inequalities(structure) else ()),
             *((REFERENCE,) if structure.moving else ())]
    values: dict[str, float] = {
        **{field.name.upper(): layout.first_row(field) for field in named},
        **{f'{memory.name}_ROWS': layout.rows(memory) for memory in Memory},
        **options.constants(), 'PI': math.pi, 'TERMINAL_LEVEL': TERMINAL_LEVEL,
        'POINTING_AXIS': POINTING_AXIS,
        'POINTING': int(structure.pointing), 'SYMMETRIC': int(structure.symmetric),
        'LEAST_SHARE': LEAST_SHARE, 'SAFETY': SAFETY, 'LEAST_PART': LEAST_PART,
        'HAS_TERMINAL_SET': int(terminal_level(structure) is not None),
        'CURVED': int(any(each.curved for each in node_inequalities(structure)))}
    lines = [f'#define {name} {value if isinstance(value, int) else number(value)}'
             for name, value in values.items()]
    rates = [f'{{{layout.first_row(each.data)}, {each.data.size}}}'
             for each in rate_inequalities(structure)]
    facets = [each.rows // 2 for each in wheel_inequalities(structure)]
    return '\n'.join([*lines, f'#define WARM_STARTS {options.warm_starts()}',
                      f'#define RATE_LIMITS {{{", ".join(rates) or "{0, 0}"}}}',
                      *(f'#define WHEEL_FACETS {each}' for each in facets[:1]),
                      *_cone_defines(structure), ''])


def _cone_defines(structure: Structure) -> list[str]:
    """Return where numbers and directions of each cone lie, of which value and kind it is."""
    layout, places, value = layout_of(structure), [], 0
    for each in cone_inequalities(structure):
        for i in range(each.cones):
            places.append(f'{{{layout.first_row(each.data) + 4 * i}, '
                          f'{layout.first_row(each.direction) + 3 * i}, '
                          f'{layout.first_row(each.direction_N) + 3 * i}, '
                          f'{value + i // each.members}, {int(each.members > 1)}}}')
        value += each.rows
    return [f'#define CONE_COUNT {len(places)}', f'#define CONES {{{", ".join(places)}}}'
            ] if places else []


def parts_code(structure: Structure, without: str = '') -> str:
    """Return the phases and the functions that run the parts of a solve, without one of them."""
    parts = {name: part for name, part in program_of(structure)._asdict().items()
             if part and name != without}
    phases = {phase.name: phase for part in parts.values() for phase in part}
    return '\n'.join([
        *(phase_code(phase, layout_of(structure)) for phase in phases.values()),
        *(_part_code(name, part) for name, part in parts.items())])


def source(name: str) -> str:
    """Return one of the sources beside this module."""
    return (Path(__file__).resolve().parent / name).read_text(encoding='utf-8')


def controller_code(structure: Structure) -> str:
    """Return what is written by hand around the phases."""
    cones, wheels = cone_inequalities(structure), wheel_inequalities(structure)
    return '\n'.join(source(name) for name, used in (
        ('driver.c', True), ('controller.c', True), ('vectors.c', cones or wheels),
        ('ways.c', cones), ('cones.c', cones), ('wheels.c', wheels),
        ('reference.c', structure.moving), ('search.c', True)) if used)


def program_code(structure: Structure) -> str:
    """Return the whole solver as one C file, with what Python calls."""
    return '\n'.join([
        source('lanes.h'), defines(structure), parts_code(structure),
        controller_code(structure), source('python.c')])
