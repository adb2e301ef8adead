# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States in the shipped messages, as the simulator publishes them."""

from __future__ import annotations

from typing import Any

from manifold_mpc_ros.config.description import state_description
from manifold_mpc_ros.config.interfaces import message_class
from manifold_mpc_ros.control.described.state_writer import StateWriter
from manifold_mpc_ros.control.input_gate import StateSample


def state_message(given: str, sample: StateSample) -> Any:
    """Return a state in the message of a description that has one topic."""
    described = state_description(given)
    message = message_class(described.attitude.message_type)()
    StateWriter(described, ('inertial', 'base_link'), (1e-4, 1e-6)).fill(
        {described.attitude.topic: message}, sample)
    return message
