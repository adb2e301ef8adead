# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A regulation problem on a manifold: what paper sections 2 to 4 assume, and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import casadi as ca

from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import Manifold

StepMap = Callable[[ca.SX, ca.SX], ca.SX]


@dataclass(frozen=True, eq=False)
class ManifoldProblem:
    """Steer ``x_{k+1} = f(x_k, u_k)`` on M to the origin at stage costs L(x, u).

    Arguments
    ---------
    name
        What reports call the problem.
    states, controls
        M and U, each with its chart (phi, psi) at the equilibrium x_e, u_e.
    step
        f: (x, u) -> x, points as ambient columns; ``f(x_e, u_e) = x_e``.
    stage_cost
        L: (x, u) -> scalar, zero at the equilibrium.
    terminal_scale
        lambda in (0, 1): the terminal design is for ``L / lambda``.
    control_limits
        Half widths (m,) of the box on psi^-1(u), inf where there is none; None for no limit.
    control_facets
        Normals n_f (k, m) and bounds (k,) of ``|n_f . psi^-1(u)| <= bound_f``, a polytope that is
        a limit too; None for none.
    control_name
        What reports call that box.
    state_limits
        By name, g with ``g(x) <= 0`` (each entry) where the state is admissible; smooth, so
        ``+-x - limit`` rather than ``|x| - limit``, whose kink no optimiser gets past.
    existence
        (x, u) -> a number below 1 wherever f is guaranteed to exist; None when it always is.
    state_units, control_units
        Typical sizes (n,), (m,) of the coordinates, by which numerics are balanced.

    """

    name: str
    states: Manifold
    controls: Manifold
    step: StepMap
    stage_cost: StepMap
    terminal_scale: float
    state_units: Array
    control_units: Array
    control_limits: Array | None = None
    control_facets: tuple[Array, Array] | None = None
    control_name: str = 'control'
    state_limits: Mapping[str, Callable[[ca.SX], ca.SX]] = field(default_factory=dict)
    existence: StepMap | None = None
