# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CasADi functions on many points at once.

CasADi's virtual machine takes points one after the other, at about 10 ns an instruction. For
thousands of points numpy runs the same instructions, one after the other, each on all points.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from manifold_mpc_ros.lie.arrays import Array

# Points a pass of the numpy program takes, so that its registers stay in the processor's cache.
_CHUNK = 4000
# With fewer points than this the virtual machine is faster.
_FEW = 200


def _select(condition: Array, value: Array, out: Array) -> None:
    """Write the value where the condition is not zero, 0 elsewhere."""
    out[:] = np.where(condition, value, 0.0)


def _double(value: Array, out: Array) -> None:
    """Write twice the value."""
    np.add(value, value, out=out)


_OPERATIONS: dict[int, Callable[..., object]] = {
    ca.OP_NEG: np.negative, ca.OP_SQ: np.square, ca.OP_SQRT: np.sqrt, ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos, ca.OP_TAN: np.tan, ca.OP_ASIN: np.arcsin, ca.OP_ACOS: np.arccos,
    ca.OP_ATAN: np.arctan, ca.OP_EXP: np.exp, ca.OP_LOG: np.log, ca.OP_SINH: np.sinh,
    ca.OP_COSH: np.cosh, ca.OP_TANH: np.tanh, ca.OP_FABS: np.fabs, ca.OP_SIGN: np.sign,
    ca.OP_NOT: np.logical_not, ca.OP_INV: np.reciprocal, ca.OP_ASSIGN: np.positive,
    ca.OP_ADD: np.add, ca.OP_SUB: np.subtract, ca.OP_MUL: np.multiply, ca.OP_DIV: np.divide,
    ca.OP_ATAN2: np.arctan2, ca.OP_FMIN: np.fmin, ca.OP_FMAX: np.fmax, ca.OP_LT: np.less,
    ca.OP_LE: np.less_equal, ca.OP_EQ: np.equal, ca.OP_NE: np.not_equal,
    ca.OP_AND: np.logical_and, ca.OP_OR: np.logical_or, ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power, ca.OP_TWICE: _double, ca.OP_IF_ELSE_ZERO: _select,
}

# Called with operands and ``out``, in order.
Program = list[tuple[Callable[..., object], tuple[Array, ...], Array]]


class Batch:
    """A scalar expression of a vector as a function of many vectors."""

    def __init__(self, argument: ca.SX, value: ca.SX) -> None:
        """Compile ``value`` (scalar) as a function of ``argument`` (n,)."""
        self._function = ca.Function('value', [argument], [value], {'cse': True})
        self._mapped: dict[int, ca.Function] = {}
        self._points = np.empty((argument.numel(), _CHUNK))
        self._values = np.zeros(_CHUNK)
        self._program = self._translated()

    def __call__(self, points: Array) -> Array:
        """Map points (k, n) to values (k,)."""
        if len(points) < _FEW or self._program is None:
            return self._by_virtual_machine(points)
        return np.concatenate([self._by_numpy(points[start:start + _CHUNK])
                               for start in range(0, len(points), _CHUNK)])

    def _by_virtual_machine(self, points: Array) -> Array:
        """Map points (k, n), one after the other."""
        count = len(points)
        if count not in self._mapped:
            self._mapped[count] = self._function.map(count)
        return np.array(self._mapped[count](points.T))[0]

    def _by_numpy(self, points: Array) -> Array:
        """Map up to a chunk of points (k, n), instruction after instruction."""
        assert self._program is not None
        self._points[:, :len(points)] = points.T
        with np.errstate(all='ignore'):
            for operation, operands, out in self._program:
                operation(*operands, out=out)
        return self._values[:len(points)].copy()

    def _translated(self) -> Program | None:
        """Return the function's instructions on arrays; None when one of them is not known."""
        function, program = self._function, Program()
        work = np.zeros((function.sz_w(), _CHUNK))
        for k in range(function.n_instructions()):
            operation = function.instruction_id(k)
            given, to = function.instruction_input(k), function.instruction_output(k)
            if operation == ca.OP_CONST:
                constant = np.array(function.instruction_constant(k))
                program.append((np.positive, (constant,), work[to[0]]))
            elif operation == ca.OP_INPUT:
                program.append((np.positive, (self._points[given[1]],), work[to[0]]))
            elif operation == ca.OP_OUTPUT:
                program.append((np.positive, (work[given[0]],), self._values))
            elif operation in _OPERATIONS:
                program.append((_OPERATIONS[operation],
                                tuple(work[register] for register in given), work[to[0]]))
            else:
                return None
        return program
