# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Following the demo: until the loop is closed, then until the attitude has settled."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from manifold_mpc_ros.cli.processes import NodeProcesses
from manifold_mpc_ros.config.guidance import GUIDANCE_NAME
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.demo.target import DemoTarget

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.demo.bag import DemoBag
    from manifold_mpc_ros.lab.demo.display import DemoDisplay
    from manifold_mpc_ros.lab.recording.nodes.history import Recorder

# The body has to stay within the tolerances for this long before it counts as settled [s].
HOLD_S = 2.0
LISTEN_S = 0.1


class StartWatch:
    """The time until the loop is closed, which has a limit."""

    def __init__(
        self, recorder: Recorder, processes: NodeProcesses, limit_s: float, display: DemoDisplay,
    ) -> None:
        """Begin to count."""
        self._recorder, self._processes = recorder, processes
        self._limit_s, self._display = limit_s, display
        self._begun_s = time.monotonic()
        self.elapsed_s = 0.0

    def until(self, condition: Callable[[], bool]) -> None:
        """Listen until the condition holds; raises what `look` raises."""
        self._recorder.until(condition, self.look)

    def look(self) -> None:
        """Show how far the start is; `elapsed_s` is the wall clock used so far.

        Raises ManifoldMpcError when a node ends or the limit is reached.
        """
        self.elapsed_s = time.monotonic() - self._begun_s
        if self.elapsed_s > self._limit_s:
            raise ManifoldMpcError(
                f'no torque came within {self._limit_s:g} s of the start '
                f'({self._recorder.states} states seen); the nodes said: ' + '; '.join(
                    f'{node.name}: {node.last_words()}' for node in self._processes.nodes))
        _require_running(self._processes)
        self._display.starting(self.elapsed_s, self._recorder.states, self._recorder.mode)


def activate_controller(
    recorder: Recorder, bag: DemoBag, processes: NodeProcesses, look: Callable[[], None], *,
    guided: bool,
) -> None:
    """Let the controller begin when every node is known to who listens, and knows them.

    With it the loop begins: in lockstep the simulator waits for nobody else. ``look`` raises to
    give up.
    """
    name = recorder.controller
    if recorder.configure(name, look):
        recorder.meet_both(look)
        guidance = f'{name.rpartition("/")[0]}/{GUIDANCE_NAME}'.strip('/')
        bag.listen([recorder.simulator, name, *guided * [guidance]], look)
        if recorder.activate(name, look):
            return
    raise ManifoldMpcError(
        f'the controller refused to start: {processes.nodes[-1].last_words()}')


def loop_is_closed(recorder: Recorder) -> bool:
    """Say whether the controller is in control, and a state has been seen.

    Topics come on their own ways: a command may be heard before the state that it answers.
    Before it has a state it commands zero: the first other torque closes the loop, or its word
    that it is in control (a body that starts where it should be needs no torque).
    """
    return recorder.states > 0 and recorder.commands > 0 and (
        bool(np.any(recorder.latest_torque())) or recorder.mode == 'NOMINAL')


def watch_until_settled(
    recorder: Recorder, processes: NodeProcesses, target: DemoTarget,
    arguments: argparse.Namespace, display: DemoDisplay, *, simulated: bool,
) -> None:
    """Listen until the body has held its attitude for a while, or the time is up.

    The wall clock is up, or ``simulated`` time.
    """
    begun_s, first_ns = time.monotonic(), recorder.latest_state()[0]
    within_since_ns: int | None = None
    elapsed_s = 0.0
    while max(elapsed_s, time.monotonic() - begun_s) < arguments.duration:
        _require_running(processes)
        recorder.spin(LISTEN_S)
        stamp_ns, R_NB, omega_BN_B = recorder.latest_state()
        elapsed_s = ((stamp_ns - first_ns) / NANOSECONDS if simulated
                     else time.monotonic() - begun_s)
        error_rad, rate_rad_s = (float(each[0]) for each in target.errors(
            np.array([stamp_ns]), R_NB[None], omega_BN_B[None]))
        display.running(elapsed_s, arguments.duration, error_rad, rate_rad_s,
                        recorder.latest_torque(), recorder.mode)
        if not _within(arguments, error_rad, rate_rad_s):
            within_since_ns = None
        elif within_since_ns is None:
            within_since_ns = stamp_ns
        elif stamp_ns - within_since_ns >= HOLD_S * NANOSECONDS:
            return


def _within(arguments: argparse.Namespace, error_rad: float, rate_rad_s: float) -> bool:
    """Say whether a state is within both tolerances."""
    return (math.degrees(error_rad) < arguments.attitude_tolerance
            and rate_rad_s < arguments.rate_tolerance)


def _require_running(processes: NodeProcesses) -> None:
    """Raise when a node has ended by itself."""
    node = processes.ended()
    if node is not None:
        raise ManifoldMpcError(
            f'the {node.name} ended by itself with exit status {node.exit_status}: '
            f'{node.last_words()} (all of it: {node.log_path})')
