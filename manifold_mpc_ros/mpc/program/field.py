# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The vectors that the solver's memory is made of."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


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
