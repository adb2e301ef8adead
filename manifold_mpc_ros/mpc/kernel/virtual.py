# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The phases in CasADi's virtual machine: what runs where there is no C compiler."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import casadi as ca
import numpy as np

from manifold_mpc_ros.mpc.kernel.phase import Field, Memory, Order, Phase, Ref
from manifold_mpc_ros.mpc.scaling import Array


class Slot(NamedTuple):
    """A field of one trajectory, of the model or of the globals."""

    field: Field
    new: bool


class _Graph:
    """Runs phases symbolically on matrices, one column per stage."""

    def __init__(self, horizon: int) -> None:
        """Start with nothing read or written."""
        self._horizon = horizon
        self.inputs: dict[Slot, ca.MX] = {}
        self.values: dict[Slot, ca.MX] = {}
        self.written: list[Slot] = []

    def run(self, phase: Phase) -> None:
        """Apply one phase."""
        stages = phase.stages(self._horizon)
        run = self._run_at_once if phase.order is Order.ALL and len(stages) > 1 else self._run_each
        run(phase, stages)

    def _matrix(self, slot: Slot) -> ca.MX:
        """Return the value of a field; an input where nothing has been written."""
        if slot not in self.values:
            columns = 1 if slot.field.memory is Memory.GLOBAL else self._horizon + 1
            self.inputs[slot] = self.values[slot] = ca.MX.sym(
                slot.field.name, slot.field.size, columns)
        return self.values[slot]

    def _write(self, slot: Slot, value: ca.MX) -> None:
        self._matrix(slot)
        self.values[slot] = value
        if slot not in self.written:
            self.written.append(slot)

    def _run_at_once(self, phase: Phase, stages: range) -> None:
        """Map the function over the stages."""
        arguments, shared = [], []
        for i, ref in enumerate(phase.reads):
            value = self._matrix(Slot(ref.field, ref.new))
            if ref.field.memory is Memory.GLOBAL:
                shared.append(i)
            else:
                wanted = [self._column(k + ref.shift) for k in stages]
                value = value if wanted == list(range(value.shape[1])) else value[:, wanted]
            arguments.append(value)
        mapped = phase.function.map(phase.name, 'serial', len(stages), shared, [])
        results = mapped(*arguments)
        results = results if isinstance(results, tuple) else (results,)
        for ref, result in zip(phase.writes, results):
            old = self._matrix(Slot(ref.field, ref.new))
            rest = old[:, len(stages):] if len(stages) < old.shape[1] else ca.MX(old.shape[0], 0)
            self._write(Slot(ref.field, ref.new), ca.horzcat(result, rest))

    def _column(self, stage: int) -> int:
        """Return a stage that exists: what is read beside the horizon is not used."""
        return min(max(0, stage), self._horizon)

    def _place(self, columns: dict[Slot, list[ca.MX]], ref: Ref, k: int) -> ca.MX:
        """Return what a reference reads at stage k."""
        column = 0 if ref.field.memory is Memory.GLOBAL else self._column(k + ref.shift)
        return columns[Slot(ref.field, ref.new)][column]

    def _run_each(self, phase: Phase, stages: range) -> None:
        """Call the function stage after stage; globals are carried from one to the next."""
        columns = {Slot(ref.field, ref.new): ca.horzsplit(self._matrix(Slot(ref.field, ref.new)))
                   for ref in (*phase.reads, *phase.writes)}
        for k in stages:
            results = phase.function(*(self._place(columns, ref, k) for ref in phase.reads))
            results = results if isinstance(results, tuple) else (results,)
            for ref, result in zip(phase.writes, results):
                column = 0 if ref.field.memory is Memory.GLOBAL else k
                columns[Slot(ref.field, ref.new)][column] = result
        for ref in phase.writes:
            slot = Slot(ref.field, ref.new)
            self._write(slot, ca.horzcat(*columns[slot]))


class Part:
    """Some phases as one function of memory that lies still."""

    def __init__(self, name: str, phases: Iterable[Phase], horizon: int) -> None:
        """Build the graph."""
        graph = _Graph(horizon)
        for phase in phases:
            graph.run(phase)
        self._reads, self._writes = list(graph.inputs), graph.written
        self._function = ca.Function(name, list(graph.inputs.values()),
                                     [ca.densify(graph.values[slot]) for slot in graph.written])

    def bind(self, memory: dict[Slot, Array]) -> Callable[[], None]:
        """Return what runs the part on this memory, each field flat in column-major order.

        The function may write a result before it has read all arguments: results get memory of
        their own and are copied.
        """
        buffer, evaluate = self._function.buffer()
        results = [np.empty(memory[slot].size) for slot in self._writes]
        targets = [memory[slot] for slot in self._writes]
        for i, slot in enumerate(self._reads):
            buffer.set_arg(i, memory[slot].data)
        for i, result in enumerate(results):
            buffer.set_res(i, result.data)
        pairs = list(zip(targets, results))

        def run() -> None:
            assert buffer is not None  # which evaluate points into, so keep it
            evaluate()
            for target, result in pairs:
                target[:] = result
        return run
