# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The phases in CasADi's virtual machine: what runs where there is no C compiler.

A phase whose stages need nothing of each other runs operation by operation, each on a vector that
has all stages: what it costs to interpret an operation is then paid once and not at every stage.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from manifold_mpc_ros.mpc.program.phase import Field, Memory, Order, Phase, Ref
from manifold_mpc_ros.mpc.scaling import Array


class Slot(NamedTuple):
    """A field of one trajectory, of the model or of the globals."""

    field: Field
    new: bool


def memory_of(field: Field, horizon: int) -> Array:
    """Return zeros for a field, as (size, stages): the stages of an entry lie side by side."""
    return np.zeros((field.size, _stages_of(field, horizon)))


def _stages_of(field: Field, horizon: int) -> int:
    return 1 if field.memory is Memory.GLOBAL else horizon + 1


def _run_on_vectors(function: ca.Function, arguments: list[list[ca.MX]]) -> list[list[ca.MX]]:
    """Apply a function of scalars to vectors, entry by entry of what it reads and writes."""
    work: list[ca.MX | None] = [None] * function.sz_w()
    results = [[ca.MX()] * function.nnz_out(i) for i in range(function.n_out())]
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        read, written = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_INPUT:
            work[written[0]] = arguments[read[0]][read[1]]
        elif operation == ca.OP_OUTPUT:
            results[written[0]][written[1]] = work[read[0]]
        elif operation == ca.OP_CONST:
            work[written[0]] = ca.MX(function.instruction_constant(k))
        elif len(read) == 1:
            work[written[0]] = ca.MX.unary(operation, work[read[0]])
        else:
            work[written[0]] = ca.MX.binary(operation, work[read[0]], work[read[1]])
    return results


def _existing(stage: int, horizon: int) -> int:
    """Return a stage that exists: what is read beside the horizon is not used."""
    return min(max(0, stage), horizon)


def _symbol(ref: Ref, horizon: int) -> ca.MX:
    """Return a symbol for what a phase reads, (stages, size)."""
    return ca.MX.sym(ref.field.name, _stages_of(ref.field, horizon), ref.field.size)


def _at_once(phase: Phase, horizon: int) -> tuple[list[ca.MX], list[ca.MX]]:
    """Return what a phase reads, and what it writes at its stages together; zeros behind them."""
    count = len(phase.stages(horizon))
    beyond = ca.MX(ca.DM.zeros(horizon + 1 - count))
    symbols = [_symbol(ref, horizon) for ref in phase.reads]
    arguments = [_shifted(symbol, ref, count, horizon)
                 for symbol, ref in zip(symbols, phase.reads)]
    results = []
    for entries in _run_on_vectors(phase.function, arguments):
        full = [entry if entry.shape[0] == count else ca.repmat(entry, count)
                for entry in entries]
        results.append(ca.horzcat(*(ca.vertcat(entry, beyond) for entry in full)))
    return symbols, results


def _shifted(value: ca.MX, ref: Ref, count: int, horizon: int) -> list[ca.MX]:
    """Return the entries that a reference reads at the first stages, each as a vector."""
    entries = list(ca.horzsplit(value))
    wanted = [_existing(k + ref.shift, horizon) for k in range(count)]
    if ref.field.memory is Memory.GLOBAL or wanted == list(range(horizon + 1)):
        return entries
    return [entry[wanted] for entry in entries]


def _one_by_one(phase: Phase, horizon: int) -> tuple[list[ca.MX], list[ca.MX]]:
    """Return what a phase reads, and what it writes at one stage after the other.

    Globals are carried from one to the next. Behind what is read comes what had been written
    before, of which the other stages are kept.
    """
    symbols = [_symbol(ref, horizon) for ref in (*phase.reads, *phase.writes)]
    columns = [list(ca.horzsplit(symbol.T)) for symbol in symbols]
    read, written = columns[:len(phase.reads)], columns[len(phase.reads):]
    for ref, stages in zip(phase.writes, written):
        if ref in phase.reads:
            read[phase.reads.index(ref)] = stages
    for k in phase.stages(horizon):
        results = phase.function(*(stages[_index(ref, k, horizon)]
                                   for ref, stages in zip(phase.reads, read)))
        results = results if isinstance(results, tuple) else (results,)
        for ref, stages, result in zip(phase.writes, written, results):
            stages[_index(ref, k, horizon)] = result
    return symbols, [ca.horzcat(*stages).T for stages in written]


def _index(ref: Ref, k: int, horizon: int) -> int:
    """Return at which stage a reference looks from stage k."""
    return 0 if ref.field.memory is Memory.GLOBAL else _existing(k + ref.shift, horizon)


def _call(phase: Phase, horizon: int, values: dict[Slot, ca.MX]) -> Sequence[ca.MX]:
    """Return what a phase makes of these values; what has not been written is zero."""
    together = phase.order is Order.ALL and len(phase.stages(horizon)) > 1
    symbols, results = (_at_once if together else _one_by_one)(phase, horizon)
    function = ca.Function(phase.name, symbols, [ca.densify(result) for result in results],
                           {'never_inline': True})
    refs = phase.reads if together else (*phase.reads, *phase.writes)
    called = function(*(values[slot] if slot in values else ca.MX(ca.DM.zeros(symbol.shape))
                        for symbol, slot in zip(symbols, (Slot(r.field, r.new) for r in refs))))
    return called if isinstance(called, tuple) else (called,)


class Part:
    """Some phases as one function of memory that lies still."""

    def __init__(self, name: str, phases: Iterable[Phase], horizon: int) -> None:
        """Build the graph: one call per phase, which keeps their order."""
        inputs: dict[Slot, ca.MX] = {}
        values: dict[Slot, ca.MX] = {}
        written: list[Slot] = []
        for phase in phases:
            for ref in phase.reads:
                slot = Slot(ref.field, ref.new)
                if slot not in values:
                    inputs[slot] = values[slot] = _symbol(ref, horizon)
            results = _call(phase, horizon, values)
            for ref, result in zip(phase.writes, results):
                slot = Slot(ref.field, ref.new)
                values[slot] = result
                written += [] if slot in written else [slot]
        self._reads, self._writes = list(inputs), written
        self._function = ca.Function(
            name, list(inputs.values()), [values[slot] for slot in written])

    def bind(self, memory: dict[Slot, Array]) -> Callable[[], None]:
        """Return what runs the part on this memory.

        The function may write a result before it has read all arguments: a field that is read and
        written gets its result in memory of its own, which is copied.
        """
        buffer, evaluate = self._function.buffer()
        copies = []
        for i, slot in enumerate(self._reads):
            buffer.set_arg(i, memory[slot].data)
        for i, slot in enumerate(self._writes):
            result = memory[slot]
            if slot in self._reads:
                result = np.empty_like(memory[slot])
                copies.append((memory[slot], result))
            buffer.set_res(i, result.data)

        def run() -> None:
            assert buffer is not None  # which evaluate points into, so keep it
            evaluate()
            for target, result in copies:
                target[:] = result
        return run
