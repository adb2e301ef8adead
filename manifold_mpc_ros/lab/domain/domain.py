# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The domain of attraction D_N (paper Dn_defn): the smallest N of each of many states.

``D_N`` is the set of states from which N admissible steps lead into the terminal set X_T while
every limit holds; by Theorem 1 of the paper it is the basin of attraction of the controller.
The sets are nested, ``D_0 = X_T, D_N in D_{N+1}``: a plan of N steps ends in X_T, where the
local law is admissible and stays in X_T (paper (8a), (8b)), so one step of it makes a plan of
N + 1 steps. Hence each state has a smallest N, found by bisection, and the largest of them is
the N* of Proposition 1 for the states that were asked. Between those, nothing is certified.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.domain.feasibility import Feasibility
from manifold_mpc_ros.lab.domain.states import States
from manifold_mpc_ros.lab.workers import Workers
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array, IntArray
from manifold_mpc_ros.terminal.design import TerminalDesign

LARGEST_HORIZON = 160
# The smallest N of a state from which no horizon tried leads into the terminal set.
NONE = -1
# States that a worker takes at a time: half a second at most, which an interrupt waits for.
_CHUNK = 40


class Round(NamedTuple):
    """How far a round is: the N it tries, how many states of it were tried and found inside.

    ``decided`` of all ``states`` have their smallest N.
    """

    number: int
    horizons: tuple[int, ...]
    tried: int
    found: int
    to_try: int
    decided: int
    states: int


Progress: TypeAlias = Callable[[Round], None]


@dataclass(frozen=True)
class Settings:
    """How the search runs; the answer does not depend on ``workers``."""

    largest: int = LARGEST_HORIZON
    workers: int = 1
    backend: str = 'auto'
    cache_dir: str | Path | None = None


@dataclass(frozen=True)
class Domain:
    """States and the smallest N (n,) from which each reaches X_T, NONE where none was found."""

    states: States
    smallest: IntArray

    @property
    def largest(self) -> int:
        """The smallest N that is enough for all of these states, NONE where there is none."""
        return NONE if np.any(self.smallest == NONE) else int(self.smallest.max())

    @property
    def hardest(self) -> int:
        """The index of a state that needs the largest N; the one of largest angle among equals."""
        needed = np.where(self.smallest == NONE, np.iinfo(np.int_).max, self.smallest)
        angles = np.where(needed == needed.max(),
                          np.linalg.norm(self.states.vectors, axis=1), -1.0)
        return int(np.argmax(np.round(angles, 9)))

    def inside(self, n: int) -> IntArray:
        """Return which of the states (n,) are in D_n, as 0 and 1."""
        return ((self.smallest != NONE) & (self.smallest <= n)).astype(int)


class _Solvers:
    """One worker's searches for feasible plans, by N, each built when it is first needed."""

    def __init__(self, config: AttitudeMpcConfig, terminal: TerminalDesign, settings: Settings
                 ) -> None:
        """Keep what is needed for building them."""
        self._config, self._terminal, self._settings = config, terminal, settings
        self._by_horizon: dict[int, Feasibility] = {}

    def of(self, horizon: int) -> Feasibility:
        """Return the search with this N."""
        if horizon not in self._by_horizon:
            self._by_horizon[horizon] = Feasibility(
                replace(self._config, horizon=horizon), self._terminal,
                backend=self._settings.backend, cache_dir=self._settings.cache_dir)
        return self._by_horizon[horizon]


class _Job(NamedTuple):
    """Some states, by index, to try with one N."""

    horizon: int
    states: IntArray
    R_NB: Array
    omega_BN_B: Array


def _build(solvers: _Solvers, horizon: int) -> None:
    """Compile the solver of one N, or load it."""
    solvers.of(horizon)


def _try(solvers: _Solvers, job: _Job) -> list[bool]:
    """Return for each state of a job whether a feasible plan was found."""
    search = solvers.of(job.horizon)
    return [search.plan(R, omega) is not None for R, omega in zip(job.R_NB, job.omega_BN_B)]


class _Brackets:
    """For each state the largest N known to fail and the smallest known to succeed."""

    def __init__(self, inside: NDArray[np.bool_], first: int, largest: int, only_largest: bool
                 ) -> None:
        """Start from N = 0, which is enough for the states inside X_T."""
        self._first, self._largest, self._only_largest = first, largest, only_largest
        self.low = np.zeros(len(inside), dtype=int)
        self.high = np.where(inside, 0, largest + 1)

    def open(self) -> IntArray:
        """Return the undecided states; the largest smallest N needs only some of them."""
        undecided = self.high - self.low > 1
        if self._only_largest:
            undecided &= self.high > self.low.max() + 1
        return np.flatnonzero(undecided)

    def wanted(self, index: IntArray) -> IntArray:
        """Return the N to try: between the two, or doubled where no N is known to succeed.

        A failure takes all starts and twenty times as long, so the N of many states are sought
        from above; of one N for all there are few, and each has to be compiled.
        """
        low, high = self.low[index], self.high[index]
        doubled = np.clip(2 * low, self._first, self._largest)
        part = 2 if self._only_largest else 4
        return np.where(high <= self._largest, high - -(-(high - low) // part), doubled)

    def learn(self, index: IntArray, horizon: int, found: Sequence[bool]) -> None:
        """Narrow the brackets of the states that were tried with this N."""
        self.high[index] = np.where(found, horizon, self.high[index])
        self.low[index] = np.where(found, self.low[index], horizon)

    def smallest(self) -> IntArray:
        """Return the smallest N of each state."""
        return np.where(self.high <= self._largest, self.high, NONE)


def smallest_horizons(
    config: AttitudeMpcConfig, terminal: TerminalDesign, states: Sequence[States], *,
    settings: Settings | None = None, only_largest: bool = False,
    progress: Progress | None = None,
) -> list[Domain]:
    """Return for each group of states the smallest N of every state in it.

    The configured horizon is tried first. With ``only_largest`` the bisection stops for states
    that cannot need more than others do: the largest N is right, the others are upper bounds.
    """
    settings = settings or Settings()
    R = so3.exp(np.concatenate([group.vectors for group in states]))
    omega = np.concatenate([group.rates for group in states])
    # D_0 = X_T: is the state there already? The solver's own formula of xi^T P xi / c.
    first = min(config.horizon, settings.largest)
    make = partial(_Solvers, config, terminal, settings)
    at_end = make().of(first)
    inside = np.array([at_end.terminal_ratio(*state) <= 1 for state in zip(R, omega)])
    brackets = _Brackets(inside, first, settings.largest, only_largest)
    with Workers(make, settings.workers) as workers:
        number = 0
        while len(index := brackets.open()):
            number += 1
            _run_round(workers, brackets, index, R, omega, number, progress)
    cuts = np.cumsum([len(group) for group in states])[:-1]
    return [Domain(group, smallest) for group, smallest
            in zip(states, np.split(brackets.smallest(), cuts))]


def _run_round(
    workers: Workers[_Solvers], brackets: _Brackets, index: IntArray, R: Array, omega: Array,
    number: int, progress: Progress | None,
) -> None:
    """Try each of these states with its own N: first build what is new, each N once."""
    wanted = brackets.wanted(index)
    horizons = tuple(int(n) for n in np.unique(wanted))
    for _ in workers.run(_build, horizons):
        pass
    jobs = []
    for n in horizons:
        these = index[wanted == n]
        jobs += [_Job(n, part, R[part], omega[part]) for part
                 in np.array_split(these, -(-len(these) // _CHUNK))]
    tried = found = 0
    for at, answers in workers.run(_try, jobs):
        brackets.learn(jobs[at].states, jobs[at].horizon, answers)
        tried, found = tried + len(answers), found + sum(answers)
        if progress is not None:
            progress(Round(number, horizons, tried, found, len(index),
                           len(R) - len(brackets.open()), len(R)))
