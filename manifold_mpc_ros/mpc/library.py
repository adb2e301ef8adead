# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The compiled library of a structure: its functions, and the structs that they take."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

from manifold_mpc_ros.errors import SolverBuildError

_POINTER, _DOUBLE, _INTEGER = ctypes.c_void_p, ctypes.c_double, ctypes.c_long


def _fields(*kinds: tuple[Any, str]) -> list[tuple[str, Any]]:
    return [(name, kind) for kind, names in kinds for name in names.split()]


class Solve(ctypes.Structure):
    """The struct ``solve`` of driver.c."""

    _fields_ = _fields(
        (_POINTER, 'plan fresh model g'),
        (_DOUBLE, 'cost logs mu exact stationarity products decrease least_residual'),
        (_INTEGER, 'horizon flag passes total_passes by_tenths creeping from_afar watchdog '
         'unhalved'))


class Kept(ctypes.Structure):
    """The struct ``plan`` of search.c."""

    _fields_ = _fields((_POINTER, 'memory'), (_DOUBLE, 'cost residual'), (_INTEGER, 'flag'))


class Controller(ctypes.Structure):
    """The struct ``controller`` of search.c."""

    _fields_ = _fields(
        (Solve, 'solve'), (Kept, 'kept best other'), (_POINTER, 'starts answer reported ways '
         'cones wheels follow periods reference momentum'),
        (_DOUBLE, 'time_s torque_n_m rate_rad_s cost step_s quickest linear_rad '
         'guard_squared level'),
        (_DOUBLE * 3, 'disturbance_n_m'), (_DOUBLE, 'value_bound deadline_s local_s '
         'whole_level cone_level wheel_share share rate_share limits_used'),
        (_DOUBLE * 3, 'torque_limit_n_m torque_share'), (_DOUBLE * 9, 'aimed'),
        (_INTEGER, 'start_count wheel_count cone_count allowed warm inside violating free passes '
         'searched tracking rests missing as_configured held'))


class LoopRecord(ctypes.Structure):
    """The struct ``loop_record`` of python.c: addresses of what a closed loop writes."""

    _fields_ = _fields((_POINTER, 'states torques costs passes'), (_INTEGER, 'ticks'))


class Library:
    """The functions of a compiled solver (python.c), as attributes of their names."""

    answer: Callable[..., None]
    begin: Callable[..., None]
    disturb: Callable[..., None]
    set_directions: Callable[..., int]
    set_reference: Callable[..., None]
    set_state: Callable[..., int]
    slew_steps: Callable[..., float]
    use_set: Callable[..., None]
    begin_start: Callable[..., None]
    begin_slew: Callable[..., None]
    begin_way: Callable[..., None]
    iterate: Callable[..., None]
    report: Callable[..., None]
    model: Callable[..., None]
    try_step: Callable[..., None]
    advance: Callable[..., None]
    move_on: Callable[..., int]
    follow: Callable[..., int]

    def __init__(self, path: Path) -> None:
        """Load it; raises SolverBuildError when it cannot be loaded."""
        signatures: dict[str, tuple[Any, ...]] = {
            'answer': (None, _DOUBLE, _INTEGER), 'begin': (None,), 'disturb': (None, _POINTER),
            'set_directions': (_INTEGER, _POINTER), 'set_reference': (None, _INTEGER),
            'set_state': (_INTEGER,),
            'slew_steps': (_DOUBLE,), 'use_set': (None, _INTEGER),
            'begin_start': (None, _POINTER, _DOUBLE), 'begin_slew': (None, _DOUBLE),
            'begin_way': (None, _POINTER), 'iterate': (None, _INTEGER, _DOUBLE),
            'report': (None,), 'model': (None, _DOUBLE), 'try_step': (None, _DOUBLE),
            'advance': (None,), 'move_on': (_INTEGER, _POINTER, _POINTER, _DOUBLE),
            'follow': (_INTEGER, _POINTER, _INTEGER)}
        try:
            library = ctypes.CDLL(str(path))
            self.lanes = int(library.mpc_lane_count())
            for name, (result, *arguments) in signatures.items():
                function = getattr(library, f'mpc_{name}')
                function.argtypes, function.restype = (_POINTER, *arguments), result
                setattr(self, name, function)
        except (OSError, AttributeError) as error:
            raise SolverBuildError(f'cannot load the compiled solver {path}: {error}') from error
