# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The life of a node's process: arguments, start, signals, orderly end.

Exit status: 0 after SIGINT or SIGTERM, 1 when the node cannot start (one message says why), 2 for
arguments that nobody knows.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from types import FrameType
from typing import TYPE_CHECKING

from manifold_mpc_ros.config.yaml_file import applies, sections_of
from manifold_mpc_ros.errors import ConfigurationError, missing_package
from manifold_mpc_ros.nodes.log_folder import NO_LOG_FILE, why_no_log_file
from manifold_mpc_ros.nodes.security import demand_keystore
from manifold_mpc_ros.nodes.usage import Arguments, Program, parse_arguments

if TYPE_CHECKING:
    from manifold_mpc_ros.nodes.managed_node import ManagedNode

#: Longest wait in the executor; a signal is seen within it [s].
_SPIN_S = 0.05
#: A publisher outlives its last message by this, or readers may drop both together [s].
_LINGER_S = 0.05
#: A request to end at once that has not been heeded is repeated after this [s].
_AGAIN_S = 0.05


class StopRequest:
    """Remembers that SIGINT or SIGTERM came, and ends what must not be waited for.

    rclpy's own handlers would take the context away before a last command could be sent, so the
    process uses these. While nothing has started yet, or the node is busy configuring (the solver
    may take seconds to build), the signal ends the process at once through SystemExit(0). CasADi
    calls Python back from C++ and drops what is raised there, so the exception is raised again
    until it gets through.
    """

    def __init__(self) -> None:
        """Take over both signals."""
        self.requested = False
        self.at_once: Callable[[], bool] = lambda: True
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
            signal.signal(number, self._handle)

    def heeded(self) -> None:
        """Raise no more: the process is on its way out."""
        self.at_once = lambda: False
        signal.setitimer(signal.ITIMER_REAL, 0.0)

    def _handle(self, _number: int, _frame: FrameType | None) -> None:
        """Note the request; unwind now where that is allowed."""
        self.requested = True
        if self.at_once():
            signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
            raise SystemExit(0)


def run(program: Program, node_class: str, argv: Sequence[str] | None = None) -> int:
    """Run one node until a signal ends it; return the exit status of the process.

    ``node_class`` is 'module:Class', imported late, so that ``--help`` needs no ROS. With the
    arguments of the process itself (``argv`` None) the process ends here.
    """
    stop = StopRequest()
    try:
        status = _run_checked(program, node_class, argv, stop)
    finally:
        stop.heeded()
    if argv is None:
        _leave(status)
    return status


def _run_checked(
    program: Program, node_class: str, argv: Sequence[str] | None, stop: StopRequest,
) -> int:
    """Check arguments, parameter files and the keystore, then run the node."""
    arguments = parse_arguments(program, sys.argv[1:] if argv is None else argv)
    try:
        sections = {path: sections_of(path) for path in arguments.parameter_files}
        demand_keystore(os.environ)
    except ConfigurationError as error:
        return _fail(program, error)
    try:
        import rclpy
        module, _, name = node_class.partition(':')
        factory = getattr(importlib.import_module(module), name)
    except ImportError as error:
        return _fail(program, missing_package(error) or error)
    try:
        return _run_with_ros(program, factory, arguments, sections, stop)
    finally:
        stop.heeded()
        rclpy.try_shutdown()


def _run_with_ros(
    program: Program, factory: type[ManagedNode], arguments: Arguments,
    sections: Mapping[str, list[str]], stop: StopRequest,
) -> int:
    """Initialise ROS, start the node, spin until the end; ``sections``: of each parameter file."""
    import rclpy
    from rclpy.exceptions import NameValidationException, ParameterException
    from rclpy.signals import SignalHandlerOptions

    try:
        no_log_file = why_no_log_file(os.environ)
        more = NO_LOG_FILE if no_log_file else ()
        rclpy.init(args=[program.executable, *arguments.ros, *more],
                   signal_handler_options=SignalHandlerOptions.NO)
        node = factory(program, complete=bool(arguments.parameter_files))
        if no_log_file:
            node.get_logger().warning(no_log_file)
    except (RuntimeError, ParameterException, NameValidationException) as error:
        return _fail(program, ' '.join(str(error).split()))
    stop.at_once = lambda: node.configuring
    try:
        unused = _without_section(sections, node.get_fully_qualified_name())
        if unused and len(unused) == len(sections):
            return _fail(program, '; '.join(map(str, unused)))
        for mistake in unused:
            node.get_logger().warning(str(mistake))
        return _live(node, stop)
    finally:
        stop.heeded()
        node.destroy_node()


def _without_section(
    sections: Mapping[str, list[str]], full_name: str,
) -> list[ConfigurationError]:
    """Return what is wrong with the files of which a node reads nothing."""
    expected = f'a section for {full_name!r}, the full name of this node'
    return [ConfigurationError(path, keys, expected)
            for path, keys in sections.items() if not any(applies(key, full_name) for key in keys)]


def _live(node: ManagedNode, stop: StopRequest) -> int:
    """Start the node when it starts by itself, spin, and end it in order."""
    import rclpy
    from rclpy.lifecycle import TransitionCallbackReturn

    from manifold_mpc_ros.nodes.executor import GuardedExecutor

    executor = GuardedExecutor(node.barrier)
    executor.add_node(node)
    try:
        if node.autostart:
            for transition in (node.trigger_configure, node.trigger_activate):
                if transition() != TransitionCallbackReturn.SUCCESS:
                    return 0 if stop.requested else 1
        while not stop.requested and rclpy.ok():
            executor.spin_some(_SPIN_S)
        return 0
    finally:
        if node.active:
            node.trigger_deactivate()
            time.sleep(_LINGER_S)
        executor.shutdown(timeout_sec=0)


def _leave(status: int) -> None:
    """End the process without joining the solver thread and without finalising Python."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def _fail(program: Program, reason: object) -> int:
    """Say on stderr why the process ends; return its exit status."""
    sys.stderr.write(f'{program.executable}: {reason}\n')
    return 1
