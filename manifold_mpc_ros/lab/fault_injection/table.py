# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All faults, and the short selection that is run at every change."""

from __future__ import annotations

from collections.abc import Sequence

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.fault_injection.disturbances import lost
from manifold_mpc_ros.lab.fault_injection.fault import STATE, Expectation, Fault, OnTopic
from manifold_mpc_ros.lab.fault_injection.table_messages import (
    CLOCK_FAULTS,
    MOSTLY_NOMINAL,
    STATE_FAULTS,
    TORQUE_FAULTS,
)
from manifold_mpc_ros.lab.fault_injection.table_processes import PROCESS_FAULTS, REQUEST_FAULTS

#: The control group: what is held against the nodes here is not the fault's doing.
NO_FAULT = Fault('none', 'nothing', 'no fault', OnTopic(STATE, lost(0.0)),
                 Expectation(stays=MOSTLY_NOMINAL))
FAULTS: tuple[Fault, ...] = (
    NO_FAULT, *STATE_FAULTS, *TORQUE_FAULTS, *REQUEST_FAULTS, *PROCESS_FAULTS, *CLOCK_FAULTS)
_BY_NAME = {fault.name: fault for fault in FAULTS}

#: At least one of each kind, in half a minute.
QUICK = (
    'none', 'state-nan-attitude', 'state-zero-quaternion', 'state-signs', 'state-noise',
    'state-wrong-frame', 'state-stale', 'state-frozen', 'state-fast', 'state-lost-50',
    'state-lost', 'state-jitter', 'state-publisher-dies', 'state-second-publisher',
    'state-random-bytes', 'state-truncated', 'torque-nan', 'torque-lost', 'torque-dead-axis',
    'torque-second-publisher', 'torque-flipped-bits', 'controller-parameters-malformed',
    'controller-parameters-hostile', 'parameters-atomic', 'controller-lifecycle-invalid',
    'controller-cycled',
    'setpoints-bad', 'torque-misfit', 'controller-datagrams', 'controller-killed',
    'simulator-killed', 'controller-terminated', 'controller-stopped', 'simulator-stopped',
    'controller-bad-start', 'hogs', 'clock-stops', 'clock-back')


def faults_named(names: Sequence[str]) -> tuple[Fault, ...]:
    """Return faults by their names; raises ConfigurationError for one that does not exist."""
    unknown = [name for name in names if name not in _BY_NAME]
    if unknown:
        raise ConfigurationError('fault', unknown[0], 'one of ' + ', '.join(_BY_NAME))
    return tuple(_BY_NAME[name] for name in names)
