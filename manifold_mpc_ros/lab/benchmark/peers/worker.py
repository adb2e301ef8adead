# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A process for each solver, so that none changes the libraries, caches or fate of another.

Solvers bring libraries of the same names with other contents (BLASFEO alone comes in two); in a
process of its own each has what it was built with, its memory can be read, and a crash is a
failure in a table. All processes are pinned to one core and asked one after the other.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.peers.memory import peak_memory_bytes
from manifold_mpc_ros.lab.benchmark.peers.solver import Answer, Entry, Solver
from manifold_mpc_ros.lie.arrays import Array

#: A solve that takes longer is not repeated [s].
SLOW_S = 0.03
#: Building, compiling and the slowest solve end within this [s].
PATIENCE_S = 300.0
#: The lowest priority ahead of every ordinary process.
_PRIORITY = 1


@dataclass(frozen=True)
class Ready:
    """What a worker says when it has built its solver."""

    build_s: float
    version: str
    undisturbed: bool


class Worker:
    """One solver at one horizon in its own process."""

    def __init__(self, entry: Entry, horizon: int, core: int | None) -> None:
        """Start the process; `wait` for it before asking anything."""
        self.entry = entry
        context = multiprocessing.get_context('spawn')
        self._connection, far = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(far, entry, horizon, core), daemon=True)
        self._process.start()
        far.close()

    def wait(self) -> Ready:
        """Return when the solver is built; raises ManifoldMpcError with the reason if not."""
        ready: Ready = self._receive()
        return ready

    def cold(self, state: Array, repeats: int) -> list[Answer]:
        """Return up to ``repeats`` answers to one state."""
        return self._ask('cold', state, repeats)

    def loop(self, state: Array, steps: int) -> list[Answer]:
        """Return the warm answers of steps 1 to ``steps`` of a closed loop from a state."""
        return self._ask('loop', state, steps)

    def improve(self, state: Array, torques: Array) -> float:
        """Return the cost of the local optimum that starts from torques (N, 3)."""
        cost: float = self._ask('improve', state, torques)
        return cost

    def peak_memory_bytes(self) -> int:
        """Return the largest resident memory so far, Python and its libraries included."""
        size: int = self._ask('memory')
        return size

    def end(self) -> None:
        """End the process."""
        self._connection.close()
        self._process.join(1.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _ask(self, *request: Any) -> Any:
        """Send a request and return what comes back."""
        try:
            self._connection.send(request)
        except OSError:
            raise ManifoldMpcError(f'{self.entry.name}: its process has died') from None
        return self._receive()

    def _receive(self) -> Any:
        """Return the next answer; raises ManifoldMpcError when there is none."""
        try:
            if not self._connection.poll(PATIENCE_S):
                raise ManifoldMpcError(f'no answer within {PATIENCE_S:.0f} s')
            answer = self._connection.recv()
        except (EOFError, OSError):
            self._process.join()
            raise ManifoldMpcError(
                f'its process died (exit status {self._process.exitcode})') from None
        if isinstance(answer, ManifoldMpcError):
            raise answer
        return answer


def _serve(connection: Connection, entry: Entry, horizon: int, core: int | None) -> None:
    """Build and answer until the other side closes; nothing is printed."""
    quiet = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(quiet, stream)
    begin = time.perf_counter()
    try:
        solver = entry.build(horizon)
    except Exception as error:  # noqa: BLE001  (whatever a foreign package raises is the reason)
        connection.send(ManifoldMpcError(_reason(error)))
        return
    build_s = time.perf_counter() - begin
    undisturbed = core is not None and take_core(core)
    connection.send(Ready(build_s, getattr(solver, 'version', ''), undisturbed))
    while True:
        try:
            request = connection.recv()
        except (EOFError, OSError):
            return
        try:
            connection.send(_answer(solver, *request))
        except Exception as error:  # noqa: BLE001
            connection.send(ManifoldMpcError(_reason(error)))


def take_core(core: int) -> bool:
    """Pin to a core, ahead of ordinary processes where that is allowed; return whether it is.

    A slow solve is interrupted more often than a fast one: without this a busy machine makes
    every ratio larger than it is.
    """
    os.sched_setaffinity(0, {core})
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    except OSError:
        return False
    return True


def _reason(error: Exception) -> str:
    """Return an error as one line."""
    words = ' '.join(str(error).split())
    return words[:200] if isinstance(error, ManifoldMpcError) else (
        f'{type(error).__name__}: {words[:200]}')


def _answer(solver: Any, verb: str, *arguments: Any) -> Any:
    """Return what a request asks for."""
    if verb == 'cold':
        return _cold(solver, *arguments)
    if verb == 'loop':
        return _loop(solver, *arguments)
    if verb == 'improve':
        return solver.improve(*arguments)
    return peak_memory_bytes()


def _cold(solver: Solver, state: Array, repeats: int) -> list[Answer]:
    """Solve one state again and again while that is quick."""
    answers: list[Answer] = []
    while len(answers) < repeats and (not answers or answers[-1].call_s < SLOW_S):
        answers.append(solver.cold(state))
    return answers


def _loop(solver: Solver, state: Array, steps: int) -> list[Answer]:
    """Close the loop over the solver's nominal plant."""
    answer, answers = solver.cold(state), []
    for _ in range(steps):
        state = solver.advance(state, answer.torques_n_m[0])
        answer = solver.warm(state)
        answers.append(answer)
    return answers


def fastest(answers: Sequence[Answer]) -> tuple[float, float]:
    """Return the least of each clock: the rest is what else the machine did meanwhile."""
    return min(each.solver_s for each in answers), min(each.call_s for each in answers)
