# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where each field lies in the memory of the compiled solver."""

from __future__ import annotations

from functools import cache

from manifold_mpc_ros.mpc.program import fields
from manifold_mpc_ros.mpc.program.phase import Field, Memory, Structure
from manifold_mpc_ros.mpc.stages.inequalities import inequalities_of
from manifold_mpc_ros.mpc.stages.reference import REFERENCE

_COMMON = tuple(value for value in vars(fields).values() if isinstance(value, Field))


class Layout:
    """The fields of a structure: those of every problem, of its inequalities, of a reference."""

    def __init__(self, structure: Structure) -> None:
        """Give every field its rows."""
        own = (field for inequality in inequalities_of(structure) for field in inequality.fields)
        self._first: dict[Field, int] = {}
        self._rows = dict.fromkeys(Memory, 0)
        moving = [REFERENCE] if structure.moving else []
        for field in dict.fromkeys((*_COMMON, *own, *moving)):  # some are shared
            self._first[field] = self._rows[field.memory]
            self._rows[field.memory] += field.size

    def fields(self, memory: Memory) -> tuple[Field, ...]:
        """Return the fields of one memory, in the order in which they lie."""
        return tuple(field for field in self._first if field.memory is memory)

    def rows(self, memory: Memory) -> int:
        """Return how many numbers one stage of a memory has."""
        return self._rows[memory]

    def first_row(self, field: Field) -> int:
        """Return the row at which a field begins in its memory."""
        return self._first[field]


@cache
def layout_of(structure: Structure) -> Layout:
    """Return the layout of a structure."""
    return Layout(structure)
