# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver's memory in blocks of vector lanes, and its fields as arrays."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program.layout import layout_of
from manifold_mpc_ros.mpc.program.phase import Field, Structure

_ALIGNMENT = 64


def aligned(size: int) -> Array:
    """Return zeros that begin at a multiple of the alignment."""
    raw = np.zeros(size + _ALIGNMENT // 8)
    skip = -raw.ctypes.data % _ALIGNMENT // 8
    return raw[skip:skip + size]


def blocks(horizon: int, lanes: int) -> int:
    """Return how many blocks of lanes hold N + 1 stages, one before them and one behind."""
    return -(-(horizon + 1) // lanes) + 2


def field_of(memory: Array, structure: Structure, field: Field, lanes: int) -> Array:
    """Return a field as it lies in its memory, (blocks from stage 0 on, lanes, size)."""
    layout = layout_of(structure)
    first = layout.first_row(field)
    rows = memory.reshape(-1, layout.rows(field.memory), lanes)
    return rows[1:, first:first + field.size, :].transpose(0, 2, 1)


def copied(blocks: Array, last: int) -> Array:
    """Return stages 0 to ``last`` of a field, (last + 1, size)."""
    return blocks.reshape(-1, blocks.shape[-1])[:last + 1]
