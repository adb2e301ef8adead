# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Model predictive control on any manifold: the general, slow, reference implementation.

`ManifoldMpc` solves :mod:`.ocp` from several starts and warm starts it by shifting; nothing in
it knows which manifold it is on. The package's attitude solver is an optimised client of the
same problem and is tested against this one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.lab.reference.ocp import OptimalControlProblem, Trajectory
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import design_terminal
from manifold_mpc_ros.terminal.problem import ManifoldProblem

# A start whose roll-out leaves the domain of f is tried again with its controls scaled by these.
GAIN_SCALES = (1.0, 0.5, 0.25, 0.125, 0.0)
# Plans whose values agree to this are equal; the earliest start then decides.
TIE = 1e-8
# A warm plan is kept while its value exceeds the promised one by no more than this.
PROMISE = 1e-6
# With at most so many controls the corners of the control box are starts, otherwise random ones.
MOST_CORNERS = 4


class Terminal(Protocol):
    """What the problem takes from the terminal design; `TerminalDesign` is such."""

    @property
    def P(self) -> Array:
        """The terminal cost's matrix (n, n), F = xi^T P xi / 2."""

    @property
    def K(self) -> Array:
        """The local law (m, n), eta = K xi."""

    @property
    def c(self) -> float:
        """The level of the terminal set, xi^T P xi <= c."""


class PlanStatus(str, Enum):
    """How a solution ended."""

    OPTIMAL = 'optimal'        # a local optimum, the best of the starts
    FEASIBLE = 'feasible'      # meets every constraint; IPOPT has not confirmed an optimum
    INFEASIBLE = 'infeasible'  # no start gave a plan that meets every constraint

    def __str__(self) -> str:
        """Return the plain text."""
        return self.value


@dataclass(frozen=True, eq=False)
class ManifoldSolution:
    """The answer to one state.

    ``promised`` is V - L(x_0, u_0), the bound on the next value that the decrease condition of
    paper eq. (8c) gives; ``value`` is inf where there is no feasible plan, and the plan then is
    the least infeasible one found.
    """

    control: Array        # first control, a point of U (ambient,)
    coordinates: Array    # the same in coordinates of psi (m,)
    plan: Trajectory
    value: float
    promised: float
    status: PlanStatus
    starts: int


class ManifoldMpc:
    """The MPC law of paper eq. (mpclaw) for any `ManifoldProblem`.

    Cold, the starts are the local law clipped to the box, its mirror image (the other way round),
    and pushes into the corners of the control box, each followed by the local law. Warm, it is
    the last plan shifted by one step with the local law appended, which paper Theorem 1 shows
    to be feasible and worth no more than was promised; all starts are tried again when the
    optimiser ends above the promise.
    """

    def __init__(self, problem: ManifoldProblem, horizon: int, terminal_constraint: bool = True,
                 *, terminal: Terminal | None = None, starts: int = 12, seed: int = 0) -> None:
        """Design the terminal ingredients (or take them) and write the problem down.

        ``starts`` is how many cold starts there are, ``seed`` draws the random ones.

        Raises DesignError when the terminal design does not exist.
        """
        self.terminal: Terminal = terminal or design_terminal(problem)
        self.ocp = OptimalControlProblem(
            problem, horizon, self.terminal.P, self.terminal.c if terminal_constraint else None)
        self.problem, self.horizon = problem, horizon
        self._starts, self._seed = starts, seed
        self._last: ManifoldSolution | None = None

    def reset(self) -> None:
        """Forget the warm start."""
        self._last = None

    def local_law(self, state: ArrayLike, gain: float = 1.0) -> Array:
        """Map a point to ``gain K xi`` clipped to the box, in control coordinates (m,)."""
        box = self.ocp.control_box
        return np.clip(gain * self.terminal.K @ self.ocp.coordinates(state), -box, box)

    def solve(self, state: ArrayLike) -> ManifoldSolution:
        """Map a point (ambient,) to the best plan found from it."""
        point, tried = np.asarray(state, dtype=float), 0
        best = None
        if self._last is not None and np.isfinite(self._last.value):
            best, tried = self._improve_shifted(point, self._last.plan), 1
            bound = self._last.promised + PROMISE * max(self._last.promised, self.ocp.cost_unit)
            if best.feasible and best.value <= bound:
                return self._keep(best, tried)
        for guess in self.starts(point):
            bound = best.value if best is not None and best.feasible else np.inf
            best = _better(
                best, self.ocp.solve(point, guess, bound=bound), self.ocp.cost_unit)
            tried += 1
        assert best is not None
        return self._keep(best, tried)

    def starts(self, state: ArrayLike) -> Iterator[Trajectory]:
        """Yield the cold starts of a point as plans, the local law's first."""
        rng, m = np.random.default_rng(self._seed), self.problem.controls.dimension
        yield self._push(state, 0, np.zeros(m))
        yield self._push(state, max(1, self.horizon // 3), None)
        corners = np.array(list(product((1.0, -1.0), repeat=m))) if m <= MOST_CORNERS else (
            rng.choice((-1.0, 1.0), size=(self._starts, m)))
        box = self.ocp.control_box
        push = np.where(np.isfinite(box), box, self.problem.control_units)
        for index in range(self._starts - 2):
            if index < len(corners):
                yield self._push(state, max(1, min(3, self.horizon // 3)), corners[index] * push)
            else:
                held = int(rng.integers(1, self.horizon + 1))
                yield self._push(state, held, rng.uniform(-1.0, 1.0, m) * push)

    def _push(self, state: ArrayLike, held: int, push: Array | None) -> Trajectory:
        """Roll out a push held for some steps and the local law after it.

        ``push`` None is the local law's mirror image; the first gain whose roll-out exists wins.
        """
        plan = None
        for scale in GAIN_SCALES:
            point, controls = np.asarray(state, dtype=float), []
            for k in range(self.horizon):
                if k >= held:
                    control = self.local_law(point, scale)
                else:
                    control = self.local_law(point, -scale) if push is None else scale * push
                controls.append(control)
                if not self.ocp.exists(point, control):
                    break
                point = self.ocp.step(point, control)
            else:
                return self.ocp.roll_out(state, np.array(controls))
            plan = self.ocp.roll_out(state, np.zeros((self.horizon, len(control))))
        assert plan is not None
        return plan

    def _improve_shifted(self, state: Array, last: Trajectory) -> Trajectory:
        """Return the better of the shifted plan and what the optimiser makes of it."""
        appended = self.local_law(last.states[-1])
        shifted = self.ocp.roll_out(state, np.vstack([last.controls[1:], appended]))
        improved = self.ocp.solve(state, shifted, near=True)
        return _better(shifted, improved, self.ocp.cost_unit)

    def _keep(self, plan: Trajectory, tried: int) -> ManifoldSolution:
        """Return a plan as the solution and remember it."""
        status = PlanStatus.INFEASIBLE
        if plan.feasible:
            status = PlanStatus.OPTIMAL if plan.success else PlanStatus.FEASIBLE
        value = plan.value if plan.feasible else float('inf')
        self._last = ManifoldSolution(
            self.ocp.control_point(plan.controls[0]), plan.controls[0], plan, value,
            value - float(plan.stage_costs[0]), status, tried)
        return self._last


@dataclass(frozen=True, eq=False)
class ManifoldLog:
    """A closed loop of n steps: n + 1 states, and n solutions, controls and stage costs paid."""

    states: Array        # (n + 1, ambient)
    controls: Array      # (n, m) coordinates of psi
    stage_costs: Array   # (n,)
    values: Array        # (n,)
    statuses: tuple[PlanStatus, ...]

    @property
    def decrease_violations(self) -> Array:
        """``V(x_{k+1}) - V(x_k) + L(x_k, u_k)`` (n - 1,): at most rounding where promised."""
        return np.diff(self.values) + self.stage_costs[:-1]


def run_on_manifold(mpc: ManifoldMpc, state: ArrayLike, steps: int) -> ManifoldLog:
    """Run the law on the problem's own system from a cold start."""
    mpc.reset()
    states = [np.asarray(state, dtype=float)]
    solutions = []
    for _ in range(steps):
        solutions.append(mpc.solve(states[-1]))
        states.append(mpc.ocp.step(states[-1], solutions[-1].coordinates))
    return ManifoldLog(
        np.array(states), np.array([s.coordinates for s in solutions]),
        np.array([s.plan.stage_costs[0] for s in solutions]),
        np.array([s.value for s in solutions]), tuple(s.status for s in solutions))


def _better(one: Trajectory | None, other: Trajectory, unit: float) -> Trajectory:
    """Return the better of two plans: feasible first, then the cheaper, ties to the first.

    Ties are relative, and absolute below a cost ``unit``. An optimum that is worth as much as
    the first plan confirms it.
    """
    if one is None:
        return other
    if not (one.feasible and other.feasible):
        return other if other.feasible or (
            not one.feasible and other.violation < one.violation) else one
    margin = TIE * max(abs(one.value), unit)
    if other.value < one.value - margin:
        return other
    confirmed = one.success or (other.success and other.value <= one.value + margin)
    return replace(one, success=confirmed)
