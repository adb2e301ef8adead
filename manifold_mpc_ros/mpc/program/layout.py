# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where each field lies in the memory of the compiled solver."""

from __future__ import annotations

from functools import cache

from manifold_mpc_ros.mpc.program import fields
from manifold_mpc_ros.mpc.program.phase import Field, Memory


@cache
def memory_fields(memory: Memory) -> tuple[Field, ...]:
    """Return the fields of one memory, in the order in which they lie."""
    found = (value for value in vars(fields).values() if isinstance(value, Field))
    return tuple(field for field in found if field.memory is memory)


@cache
def rows_of(memory: Memory) -> int:
    """Return how many numbers one stage of a memory has."""
    return sum(field.size for field in memory_fields(memory))


@cache
def first_row(field: Field) -> int:
    """Return the row at which a field begins in its memory."""
    before = memory_fields(field.memory)
    return sum(other.size for other in before[:before.index(field)])
