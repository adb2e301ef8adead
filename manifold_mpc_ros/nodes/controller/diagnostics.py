# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the controller says about a command on /diagnostics."""

from __future__ import annotations

import math

from diagnostic_msgs.msg import DiagnosticStatus

from manifold_mpc_ros.control.command import Command
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.decrease_record import Decrease
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.response.observer import ResponseObserver
from manifold_mpc_ros.control.steady_error import SteadyError
from manifold_mpc_ros.control.target import Target
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.reference import LEAST_SHARE
from manifold_mpc_ros.nodes.managed_node import Status

_LEVELS = {
    Mode.NOMINAL: DiagnosticStatus.OK,
    Mode.WAIT: DiagnosticStatus.WARN,
    Mode.PAUSED: DiagnosticStatus.WARN,
    Mode.HOLD: DiagnosticStatus.WARN,
    Mode.FALLBACK: DiagnosticStatus.WARN,
    Mode.STOPPING: DiagnosticStatus.WARN,
    Mode.COAST: DiagnosticStatus.ERROR,
    Mode.FAULT: DiagnosticStatus.ERROR,
}


def status_of(command: Command | None, loop: ControlLoop, waiting: str) -> Status:
    """Return the status after a command; ``waiting`` says what a first state waits for."""
    if command is None:
        return Status(DiagnosticStatus.WARN, waiting, {
            'mode': Mode.WAIT.value, 'command_source': 'zero'})
    first = command.mode is Mode.WAIT and loop.sample is None
    status = Status(_LEVELS[command.mode], waiting if first else command.reason, {
        'mode': command.mode.value,
        'command_source': command.source,
        'setpoint': 'commanded' if loop.commanded else 'initial',
        'commands_saturated': loop.output.saturated,
        'commands_not_finite': loop.output.not_finite,
    })
    solution = command.solution
    if solution is not None:
        status.values.update(
            solver_status=solution.status.value, iterations=solution.iterations,
            solve_time_us=solution.solve_time_s * 1e6, cost=float(solution.cost))
    if command.decrease is not None:
        _add_decrease(status, command)
    if loop.ahead.known_B_n_m is not None:
        status.values['known_disturbance_n_m'] = _numbers(loop.ahead.known_B_n_m)
    if loop.observer is not None:
        _add_response(status, loop.observer)
    if loop.sample is not None:
        _add_error(status, loop.steady_error)
    if loop.slews is not None:
        status.values['slew_profile'] = 'followed' if loop.slews.follows else 'none'
    if loop.target is not None and loop.target.moves:
        _add_target(status, command, loop.target, loop)
    return status


def _add_target(status: Status, command: Command, target: Target, loop: ControlLoop) -> None:
    """Add to a status how a target moves, and the warning where it cannot be followed."""
    warning, solution = target.warning(command.stamp_ns), command.solution
    status.values.update(target='over' if warning else 'moving', target_jumps=loop.jumps)
    if solution is not None:
        status.values['target_limits_used'] = solution.limits_used
        if solution.limits_used > 1.0 - LEAST_SHARE and not warning:
            warning = (f'the target needs {solution.limits_used:.3g} of what the limits give: '
                       'followed as near as they allow')
    if warning:
        status.level = max(status.level, DiagnosticStatus.WARN)
        status.message += f'; {warning}'


def _add_error(status: Status, error: SteadyError) -> None:
    """Add to a status what is left to turn and the rate, and the warning if the error stays."""
    status.values.update(attitude_error_deg=math.degrees(error.attitude_rad),
                         rate_error_rad_s=error.rate_rad_s)
    if (stays_rad := error.stays_rad) is not None:
        status.level = max(status.level, DiagnosticStatus.WARN)
        status.message += f'; the attitude error stays at {math.degrees(stays_rad):.3g} deg'


def _add_response(status: Status, observer: ResponseObserver) -> None:
    """Add to a status how the body answers, and the warning if it is not as declared."""
    delay = observer.delay
    status.values.update(
        disturbance_n_m=_numbers(observer.disturbance_B_n_m),
        disturbance_std_n_m=_numbers(observer.disturbance_std_n_m),
        measured_delay_s=delay.measured_s, measured_delay_std_s=delay.std_s,
        planned_delay_s=delay.delay_s)
    if delay.disagrees:
        status.level = max(status.level, DiagnosticStatus.WARN)
        status.message += (
            f'; torque acts {delay.measured_s:.3g} s after its command, not '
            f'{delay.declared_s:g} s as declared: planned with what is measured')


def _numbers(values: Array) -> str:
    """Return a vector as text."""
    return ' '.join(f'{value:.6g}' for value in values)


def _add_decrease(status: Status, command: Command) -> None:
    """Add to a status how the value decreased since the last tick, and the warning if due."""
    record = command.decrease
    assert record is not None
    words = {None: 'unknown', True: 'true', False: 'false'}
    why_none = f' ({record.reason})' if record.verdict is Decrease.NONE else ''
    status.values.update(
        value_function=record.value, promised_value=record.promised,
        decrease_excess=record.excess, relative_excess=record.relative_excess,
        promise=record.verdict.value + why_none,
        in_domain_of_attraction=words[record.in_domain],
        in_terminal_set=words[record.in_terminal_set],
        promises_made=record.counters.made, promises_checked=record.counters.checked,
        promises_broken=record.counters.broken,
        largest_relative_excess=record.counters.largest_excess,
        ticks_outside_domain=record.counters.outside_domain)
    if record.in_domain is False and command.solution is not None:
        status.level = max(status.level, DiagnosticStatus.WARN)
        status.message += ' (no plan keeps every limit and reaches the terminal set)'
    if record.warning:
        status.level = max(status.level, DiagnosticStatus.WARN)
        before = '' if command.mode is Mode.NOMINAL else f'{status.message}; '
        status.message = before + record.warning
