# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver as a list of phases: one expression per stage, and what it reads and writes.

A pass over the horizon is a sequence of phases. Each is one CasADi function of a stage k, with
declared reads and writes, run over a range of stages in a declared order: all at once (``ALL``,
no stage needs another's result), or one after another with values carried along in globals. The C
code (:mod:`manifold_mpc_ros.mpc.backends.code_generation`) is printed from this list.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple, TypeAlias

import casadi as ca


class Structure(NamedTuple):
    """What generated code depends on; all numbers, and the horizon, are run-time values.

    Forcing, target, and which inequalities there are:
    ``rows`` has (name, number of values) of each inequality that the problem has, in the order of
    the table :data:`manifold_mpc_ros.mpc.stages.inequalities.KINDS`. ``moving``: costs are about a
    reference that moves over the horizon. ``graded``: steps have lengths of their own
    (:mod:`manifold_mpc_ros.mpc.stages.graded`).
    """

    symmetric: bool
    pointing: bool
    rows: tuple[tuple[str, int], ...] = ()
    moving: bool = False
    graded: bool = False


class Memory(Enum):
    """Where a field lives: two trajectories that swap, the model of a pass, or globals."""

    TRAJECTORY = 'trajectory'
    MODEL = 'model'
    GLOBAL = 'global'


class Field(NamedTuple):
    """A vector of ``size`` at every stage, or once (``GLOBAL``)."""

    name: str
    size: int
    memory: Memory


class Order(Enum):
    """How the stages of a phase follow each other."""

    ALL = 'all'
    FORWARD = 'forward'
    BACKWARD = 'backward'


class Ref(NamedTuple):
    """A field at stage k + shift; of a trajectory the old one or the new one."""

    field: Field
    shift: int = 0
    new: bool = False


class Phase(NamedTuple):
    """``function`` maps the reads to the writes of stage k, 0 <= k < N + beyond.

    ``last`` restricts that to so many stages at the end of the range, ``only`` to so many at the
    beginning of the horizon.
    """

    name: str
    order: Order
    reads: tuple[Ref, ...]
    writes: tuple[Ref, ...]
    function: ca.Function
    beyond: int
    last: int | None
    only: int | None

    def stages(self, horizon: int) -> range:
        """Return the stages of the phase, in the order in which they run."""
        end = horizon + self.beyond if self.only is None else self.only
        stages = range(0 if self.last is None else end - self.last, end)
        return stages[::-1] if self.order is Order.BACKWARD else stages


class Read:
    """Gives an expression the symbol of a field at stage k + shift, and keeps what was asked."""

    def __init__(self) -> None:
        """Start with nothing read."""
        self.symbols: dict[Ref, ca.SX] = {}

    def __call__(self, field: Field, shift: int = 0) -> ca.SX:
        """Return the symbol of a field."""
        return self._symbol(Ref(field, shift))

    def new(self, field: Field, shift: int = 0) -> ca.SX:
        """Return the symbol of what an earlier phase has written for the new trajectory."""
        return self._symbol(Ref(field, shift, new=True))

    def _symbol(self, ref: Ref) -> ca.SX:
        if ref not in self.symbols:
            self.symbols[ref] = ca.SX.sym(ref.field.name, ref.field.size)
        return self.symbols[ref]


Expression: TypeAlias = Callable[[Read], dict[Field, ca.SX]]


def phase(name: str, expression: Expression, *, order: Order = Order.ALL, beyond: int = 0,
          last: int | None = None, only: int | None = None) -> Phase:
    """Build a phase from a function that maps what it reads to the fields that it writes.

    Trajectory fields are written to the new trajectory.
    """
    read = Read()
    values = expression(read)
    for field, value in values.items():
        assert value.shape == (field.size, 1), (name, field.name, value.shape)
    function = ca.Function(name, list(read.symbols.values()),
                           ca.cse([ca.densify(value) for value in values.values()]))
    return Phase(name, order, tuple(read.symbols),
                 tuple(Ref(field, 0, field.memory is Memory.TRAJECTORY) for field in values),
                 function, beyond, last, only)
