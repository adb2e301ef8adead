# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a compared solver has to offer, and which solvers there are."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from manifold_mpc_ros.lie.arrays import Array

#: Formulations; costs are only compared within one.
ON_THE_GROUP, IN_QUATERNIONS = 'LGVI on SO(3)', 'quaternion, RK4'


@dataclass(frozen=True)
class Answer:
    """One solve: two clocks that are never mixed, and what came out.

    ``solver_s`` is the solver's own timer; ``call_s`` the wall clock of all Python calls that a
    user needs from a new state to a torque in numpy, starting guess given.
    """

    solver_s: float
    call_s: float
    torques_n_m: Array
    cost: float
    iterations: int
    converged: bool


class Solver(Protocol):
    """One solver of the comparison problem at one horizon."""

    def cold(self, state: Array) -> Answer:
        """Solve from a state (7,), nothing of earlier solves being used."""

    def warm(self, state: Array) -> Answer:
        """Solve from the plan of the last solve, shifted by one step."""

    def advance(self, state: Array, torque_n_m: Array) -> Array:
        """Return the state after one step of the solver's own model: its nominal plant."""


@dataclass(frozen=True)
class Entry:
    """One row of the comparison: which solver, with which options, at which horizons."""

    name: str
    factory: str
    formulation: str
    options: Mapping[str, Any] = field(default_factory=dict)
    cold: bool = True
    warm: bool = True
    largest_horizon: int = 10_000
    ours: bool = False

    def load(self) -> Any:
        """Import what the solver needs of Python and return its class."""
        module, _, name = self.factory.partition(':')
        return getattr(importlib.import_module(f'{__package__}.{module}'), name)

    def build(self, horizon: int) -> Solver:
        """Build the solver; raises whatever it lacks (an import, a compiler, a plugin)."""
        solver: Solver = self.load()(horizon, **self.options)
        return solver


_CASADI, _ACADOS, _OURS = 'casadi_peer:CasadiPeer', 'acados_peer:AcadosPeer', 'ours:Ours'

OUR_LOCAL = Entry('ours, local', _OURS, ON_THE_GROUP, {'search': False}, warm=False,
                  ours=True)
OUR_SEARCH = Entry('ours, search', _OURS, ON_THE_GROUP, {'search': True}, ours=True)
ACADOS_SQP = Entry('acados SQP (HPIPM)', _ACADOS, IN_QUATERNIONS, {'qp': 'hpipm'})
ACADOS_DAQP = Entry('acados SQP (DAQP)', _ACADOS, IN_QUATERNIONS, {'qp': 'daqp'})
ACADOS_RTI = Entry('acados RTI, one step', _ACADOS, IN_QUATERNIONS,
                   {'qp': 'hpipm', 'real_time_iteration': True}, cold=False)
FATROP = Entry('fatrop', _CASADI, IN_QUATERNIONS, {'solver': 'fatrop'})
IPOPT = Entry('IPOPT', _CASADI, IN_QUATERNIONS, {'solver': 'ipopt'})
SQP_QRQP = Entry('sqpmethod (qrqp)', _CASADI, IN_QUATERNIONS,
                 {'solver': 'sqpmethod', 'qp': 'qrqp'})
SQP_HPIPM = Entry('sqpmethod (HPIPM)', _CASADI, IN_QUATERNIONS,
                  {'solver': 'sqpmethod', 'qp': 'hpipm'})
FATROP_VM = Entry('fatrop in the VM', _CASADI, IN_QUATERNIONS,
                  {'solver': 'fatrop', 'compiled': False})
IPOPT_VM = Entry('IPOPT in the VM', _CASADI, IN_QUATERNIONS,
                 {'solver': 'ipopt', 'compiled': False})

ENTRIES = (OUR_LOCAL, OUR_SEARCH, ACADOS_SQP, ACADOS_DAQP, ACADOS_RTI, FATROP, IPOPT, SQP_QRQP,
           SQP_HPIPM, FATROP_VM, IPOPT_VM)

#: What improves the best known costs of a formulation; not timed.
REFERENCES = {
    ON_THE_GROUP: Entry('reference', 'references:OnTheGroup', ON_THE_GROUP),
    IN_QUATERNIONS: Entry('reference', _CASADI, IN_QUATERNIONS,
                          {'solver': 'ipopt', 'compiled': False}),
}
