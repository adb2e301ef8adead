# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The best plan from a state: from the plan of the last tick, or by a global search."""

from __future__ import annotations

import math
import time

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.mpc import search
from manifold_mpc_ros.mpc.cone_keeper import ConeKeeper
from manifold_mpc_ros.mpc.local_solver import LocalSolver, Plan, Report, StateReport
from manifold_mpc_ros.mpc.ways import MOST_WAYS

# The shifted plan itself: so near its limits that its cost is what it would be on them.
SHIFTED_BARRIER = 1e-12
# A relative violation of a state limit above this makes a plan infeasible.
VIOLATION = 1e-6
# The warm plan is kept while its value is at most the bound that follows from the last plan, plus
# this part of it, and always when less than this angle [rad] is left to turn: no other side can
# win there.
VALUE_SLACK = 1e-2
LEAST_VALUE = 1e-3
SEARCH_ANGLE_RAD = np.pi / 2
# ... or, where a cone holds the plan back, than this.
CONE_ANGLE_RAD = 0.2
# Memory for plans: the improved one, the shifted one, the best without the terminal set, that one
# delayed; then one for each start.
_IMPROVED, _SHIFTED, _FREE, _DELAYED, _POOL = range(5)


class PlanFinder:
    """Finds plans with the terminal set (``strict``), or where that fails without (``relaxed``).

    ``plan`` is the one of the last tick; ``value_bound`` what the next plan may cost by paper
    Theorem 1, None without a warm start; ``inside`` whether the last plan ended in the set.
    """

    def __init__(self, config: AttitudeMpcConfig, strict: LocalSolver, relaxed: LocalSolver,
                 cones: ConeKeeper) -> None:
        """Allocate; the solvers are the same one where there is no terminal set."""
        self._config, self._strict, self._relaxed = config, strict, relaxed
        self._starts, self._cones = search.starts(config), cones
        self.plan = strict.new_plan()
        self._spare = [strict.new_plan() for _ in range(
            _POOL + len(self._starts) + (MOST_WAYS if config.cones else 0))]
        self.value_bound: float | None = None
        self.inside = True
        self._violating = False
        self._deadline_s = math.inf

    def reset(self) -> None:
        """Forget the warm start; the next search is global."""
        self.value_bound = None

    def keep(self, plan: Plan, report: Report) -> None:
        """Make a plan that was found the warm start of the next tick."""
        place = self._spare.index(plan)
        self.plan, self._spare[place] = plan, self.plan
        self.value_bound = plan.progress.cost - report.first_cost
        self._violating = report.violation > VIOLATION

    def first_start(self) -> tuple[Plan | None, int]:
        """Return the plan that one cold start, the short way, leads to, and the passes it took."""
        self.inside = True
        return search.global_search(self._strict, self._starts[:1], 0.0, self._spare[_POOL:])

    def find(self, state: StateReport, deadline_s: float) -> tuple[Plan | None, int, bool]:
        """Return the plan, the passes used, and whether the global search ran.

        First with the terminal set; when that cannot be reached, without it. From outside D_N
        the set is tried again at every tick, from the shifted plan only.
        """
        self._deadline_s = deadline_s
        was_inside, passes, searched = self.inside, 0, False
        if self.value_bound is not None and self._cones.allowed:
            plan, passes = self._improve(self._strict, self.plan)
            if plan is not None and self._reaches_set(plan) and (
                    not was_inside or self._stands(plan, state)):
                self.inside = True
                return plan, passes, False
        if self.value_bound is None or (was_inside and self._cones.allowed):
            best, more = self._search_both(state)
            passes, searched = passes + more, True
            if self.inside or self.value_bound is None:
                return best, passes, True
        plan, more = self._improve(self._relaxed, self.plan)
        passes += more
        if plan is None or not self._stands(plan, state):
            plan, more = self._search(self._relaxed, state)
            passes, searched = passes + more, True
        self.inside = plan is not None and self._reaches_set(plan)
        return plan, passes, searched

    def missed(self, report: Report) -> float:
        """Return by how much, relative to its level, a plan misses the terminal set."""
        return 0.0 if self._relaxed is self._strict else max(0.0, report.last_level - 1)

    def _search_both(self, state: StateReport) -> tuple[Plan | None, int]:
        """Return the best plan that ends in the terminal set, else the best without it.

        Where a slew takes many steps the set stops most starts on their way to it, so the search
        goes without it first: a plan that ends in it is as good with it, and one that does not
        leads to one that does.
        """
        steps, passes = search.slew_steps(self._config, state), 0
        self.inside = self._cones.allowed
        if not self.inside:
            return self._search(self._relaxed, state)
        if self._relaxed is self._strict or steps <= search.MANY_STEPS:
            plan, passes = self._search(self._strict, state)
            if self._relaxed is self._strict or (plan is not None and self._reaches_set(plan)):
                return plan, passes
        free, more = self._search(self._relaxed, state)
        passes += more
        if free is None or self._reaches_set(free):
            return free, passes
        if time.monotonic() > self._deadline_s:
            self.inside = False
            return free, passes
        plan, more = self._bend(free, steps)
        self.inside = plan is not None
        return plan or free, passes + more

    def _bend(self, free: Plan, steps: float) -> tuple[Plan | None, int]:
        """Return a plan into the terminal set near one that misses it, else near any start."""
        place = self._spare.index(free)
        self._spare[_FREE], self._spare[place] = free, self._spare[_FREE]
        self._spare[_DELAYED].delay(free)
        plan, passes = self._improve(self._strict, self._spare[_DELAYED])
        if plan is None or not self._reaches_set(plan):
            plan, more = search.global_search(
                self._strict, self._starts, steps, self._spare[_POOL:], self._deadline_s,
                patient=True)
            passes += more
        return (plan if plan is not None and self._reaches_set(plan) else None), passes

    def _improve(self, solver: LocalSolver, plan: Plan) -> tuple[Plan | None, int]:
        """Return the plan that a shifted one leads to, or None; and the passes it took."""
        passes = solver.improve(plan, self._deadline_s)
        if passes < 0:
            return None, -passes
        solver.keep(self._spare[_IMPROVED])
        return self._spare[_IMPROVED], passes

    def _search(self, solver: LocalSolver, state: StateReport) -> tuple[Plan | None, int]:
        """Return the best of the global search and the shifted plan, and the passes it took."""
        pointing, steps = solver.structure.pointing, search.slew_steps(self._config, state)
        due = [start for start in self._starts if search.is_due(start, state, steps, pointing)]
        best, passes = search.global_search(
            solver, due, steps, self._spare[_POOL:], self._deadline_s)
        best, more = self._cones.search(solver, best, self._spare[_POOL:], self._deadline_s)
        passes += more
        if best is not None and self.value_bound is not None:
            solver.begin_shift(SHIFTED_BARRIER, self.plan)
            shifted = self._spare[_SHIFTED]
            solver.keep(shifted)
            if shifted.progress.cost < best.progress.cost:
                best = shifted
        return best, passes

    def _reaches_set(self, plan: Plan) -> bool:
        """Return whether a plan ends in the terminal set, where there is one."""
        return self._cones.allowed and self.missed(self._strict.report(plan)) <= VIOLATION

    def _stands(self, plan: Plan, state: StateReport) -> bool:
        """Return whether an improved plan needs no search, as no other side could win."""
        near = SEARCH_ANGLE_RAD
        if self._strict.touches_cone(plan):
            near = CONE_ANGLE_RAD
            if not self._violating and self._strict.report(plan).violation > VIOLATION:
                return False
        return state.angle_rad < near or self._keeps_value_bound(plan)

    def _keeps_value_bound(self, plan: Plan) -> bool:
        """Return whether a plan's value (with penalties) is within the bound of the last plan."""
        assert self.value_bound is not None
        bound = self.value_bound + VALUE_SLACK * max(abs(self.value_bound), LEAST_VALUE)
        return plan.progress.cost <= bound
