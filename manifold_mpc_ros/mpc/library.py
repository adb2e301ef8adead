# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The compiled library of a structure: its functions, and the structs that they take."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.errors import SolverBuildError
from manifold_mpc_ros.lie.arrays import Array


class Solve(ctypes.Structure):
    """The struct ``solve`` of driver.c."""

    _fields_ = [(name, kind) for kind, names in (
        (ctypes.c_void_p, 'plan fresh model g'),
        (ctypes.c_double, 'cost logs mu exact stationarity products decrease elapsed_s'),
        (ctypes.c_long, 'horizon flag passes total_passes')) for name in names.split()]


class Course(ctypes.Structure):
    """A closed loop that the solver runs by itself: when to stop, and what is recorded.

    The struct ``course`` of driver.c. A tick is not taken when its plan violates a limit by more
    than ``violation``, or costs more than V - L of the plan before plus ``value_slack`` of that
    (at least of ``least_value``) with ``near_rad`` or more left to turn.
    """

    _fields_ = [(name, kind) for kind, names in (  # type: ignore[misc]
        (ctypes.c_double, 'near_rad violation value_slack least_value value_bound'),
        (ctypes.c_void_p, 'states torques costs passes'), (ctypes.c_long, 'ticks'),
    ) for name in names.split()]


@dataclass(frozen=True)
class LoopRecord:
    """States (T, 12) (R_NB row by row, rate), torques (T, 3), costs and passes (T,)."""

    states: Array
    torques: Array
    costs: Array
    passes: NDArray[np.int_]

    @classmethod
    def of(cls, ticks: int) -> LoopRecord:
        """Allocate for so many ticks."""
        return cls(np.zeros((ticks, 12)), np.zeros((ticks, 3)), np.zeros(ticks),
                   np.zeros(ticks, dtype=np.int_))


class Library:
    """The functions of a compiled solver (driver.c), as attributes of their names."""

    prepare: Callable[..., int]
    set_state: Callable[..., int]
    begin_slew: Callable[..., int]
    begin_shift: Callable[..., int]
    iterate: Callable[..., int]
    improve: Callable[..., int]
    report: Callable[..., int]
    advance: Callable[..., int]
    follow: Callable[..., int]
    model: Callable[..., int]
    try_step: Callable[..., int]

    def __init__(self, path: Path) -> None:
        """Load it; raises SolverBuildError when it cannot be loaded."""
        pointer, double, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_long
        signatures: dict[str, tuple[Any, ...]] = {
            'prepare': (), 'set_state': (), 'begin_slew': (double, pointer, integer),
            'begin_shift': (double, pointer), 'iterate': (integer, double),
            'improve': (pointer, double), 'report': (pointer,), 'advance': (),
            'follow': (pointer, pointer, integer), 'model': (double,), 'try_step': (double,)}
        try:
            library = ctypes.CDLL(str(path))
            self.lanes = int(library.mpc_lane_count())
            for name, arguments in signatures.items():
                function = getattr(library, f'mpc_{name}')
                function.argtypes, function.restype = (pointer, *arguments), integer
                setattr(self, name, function)
        except (OSError, AttributeError) as error:
            raise SolverBuildError(f'cannot load the compiled solver {path}: {error}') from error
