# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver's functions with their memory: start a trajectory, iterate it, read it.

All buffers are allocated once; a call costs no allocation and no conversion.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from manifold_mpc_ros.mpc import sqp
from manifold_mpc_ros.mpc.scaling import Array
from manifold_mpc_ros.mpc.sqp import Progress
from manifold_mpc_ros.mpc.structure import RATE_PENALTY, TERMINAL_PENALTY, Structure


class _Call:
    """One CasADi function bound to fixed argument and result arrays."""

    def __init__(self, function: ca.Function, arguments: list[Array], results: list[Array]
                 ) -> None:
        self._keep = (arguments, results)
        self._buffer, self._evaluate = function.buffer()
        for index, array in enumerate(arguments):
            self._buffer.set_arg(index, array.data)
        for index, array in enumerate(results):
            self._buffer.set_res(index, array.data)

    def __call__(self) -> None:
        """Evaluate; CasADi reports nothing but a flag, and our functions cannot fail."""
        self._evaluate()


class Trajectory:
    """One solver state as numpy arrays (nodes, steps, torques, duals, terminal, progress)."""

    def __init__(self, structure: Structure) -> None:
        """Allocate flat arrays; columns are stages, so reshaped views are row per stage."""
        self._structure = structure
        self.arrays = [np.zeros(rows * columns) for rows, columns
                       in sqp.state_shapes(structure)]

    @property
    def nodes(self) -> Array:
        """Nodes (N + 1, 10): quaternion, rate, Cayley parameter."""
        return self.arrays[0].reshape(self._structure.horizon + 1, -1)

    @property
    def torques(self) -> Array:
        """Torques (N, 3), dimensionless."""
        return self.arrays[2].reshape(-1, 3)

    @property
    def progress(self) -> Progress:
        """The scalars of the state."""
        return Progress(*self.arrays[5])

    @property
    def rate_violations(self) -> Array:
        """Relative violations of the rate limits (N, 6); no columns without limits."""
        s = self._structure
        first = 12 * s.torque_box + 6 * s.rate_box
        return self.arrays[3].reshape(s.horizon, -1)[:, first:first + 6 * s.rate_box]

    @property
    def terminal_violation(self) -> float:
        """``xi^T P xi / c - 1`` of the last node where positive; 0 without a terminal set."""
        return float(self.arrays[4][1]) if self._structure.terminal_set else 0.0

    @property
    def cost(self) -> float:
        """The cost without the penalties on violations, dimensionless."""
        return float(self.progress.cost - RATE_PENALTY * self.rate_violations.sum()
                     - TERMINAL_PENALTY * self.terminal_violation)

    def copy_from(self, other: Trajectory) -> None:
        """Take over another trajectory's numbers."""
        for mine, theirs in zip(self.arrays, other.arrays):
            np.copyto(mine, theirs)


class Engine:
    """The solver's functions (see :mod:`.build`) with one set of parameters."""

    def __init__(self, structure: Structure, functions: list[ca.Function], parameters: Array
                 ) -> None:
        """Bind the functions to memory of their own."""
        self.structure = structure
        n = structure.horizon
        self._flat = np.ascontiguousarray(parameters, dtype=float)
        self._q, self._omega, self._node = np.zeros(4), np.zeros(3), np.zeros(10)
        self._torques, self._leans = np.zeros(3 * n), np.zeros(3 * n)
        self._follow, self._mu = np.zeros(n), np.zeros(1)
        self._cost_node, self._cost_torque = np.zeros(10), np.zeros(3)
        self._cost, self._value = np.zeros(1), np.zeros(1)
        self._now, self._next = Trajectory(structure), Trajectory(structure)
        self._initial = _Call(functions[0], [self._q, self._omega, self._flat], [self._node])
        self._start = _Call(
            functions[1],
            [self._node, self._torques, self._leans, self._follow, self._mu, self._flat],
            self._now.arrays)
        self._iterate = _Call(functions[2], [*self._now.arrays, self._flat], self._next.arrays)
        self._stage_cost = _Call(
            functions[3], [self._cost_node, self._cost_torque, self._flat], [self._cost])
        self._terminal_value = _Call(functions[4], [self._cost_node, self._flat], [self._value])

    def set_state(self, quaternion: Array, omega: Array) -> None:
        """Set the initial node from a quaternion (w, x, y, z) and a dimensionless rate."""
        np.copyto(self._q, quaternion)
        np.copyto(self._omega, omega)
        self._initial()

    def begin_slew(self, lean: Array, lean_steps: int, long_way: bool, mu: float) -> Trajectory:
        """Start from the slew law, the long way round or not, leaning for the first steps."""
        if long_way:
            self._node[0:4] *= -1
        self._follow[:] = 0
        leans = self._leans.reshape(-1, 3)
        leans[:] = 0
        leans[:lean_steps] = lean
        self._mu[0] = mu
        self._start()
        if long_way:
            self._node[0:4] *= -1
        return self._now

    def begin_plan(self, torques: Array, mu: float) -> Trajectory:
        """Start from given torques (n, 3), n <= N, followed by the local law."""
        self._follow[:] = 2
        self._follow[:len(torques)] = 1
        self._torques[:3 * len(torques)] = np.ravel(torques)
        self._mu[0] = mu
        self._start()
        return self._now

    def iterate(self, passes: int) -> Trajectory:
        """Run up to ``passes`` more passes (a multiple of PASSES_PER_CALL); stop when done."""
        for _ in range(0, passes, sqp.PASSES_PER_CALL):
            if self._now.progress.flag != sqp.RUNNING:
                break
            self._iterate()
            self._now.copy_from(self._next)
        return self._now

    def stage_cost(self, node: Array, torque: Array) -> float:
        """Return the dimensionless stage cost L of a node (10,) and torque (3,)."""
        np.copyto(self._cost_node, node)
        np.copyto(self._cost_torque, torque)
        self._stage_cost()
        return float(self._cost[0])

    def terminal_ratio(self, node: Array) -> float:
        """Return ``xi^T P xi / c`` of a node (10,), at most 1 inside the terminal set."""
        np.copyto(self._cost_node, node)
        self._terminal_value()
        return float(self._value[0])
