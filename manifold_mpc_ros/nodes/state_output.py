# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node's states: publishers of the described messages, and the messages of each state."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.description import state_description
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.control.described.fields import WRONG_FIELD
from manifold_mpc_ros.control.described.state_writer import StateWriter
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.nodes.managed_node import ManagedNode
from manifold_mpc_ros.nodes.state_input import state_kinds

_REST = StateSample(0, np.eye(3), np.zeros(3))


class StateOutput:
    """Publishes states in the messages of each description that somebody reads."""

    def __init__(self, node: ManagedNode, config: SimulatorConfig) -> None:
        """Advertise the topics.

        Raises ConfigurationError for a message type that is not installed or a field that it
        lacks.
        """
        self._node = node
        frames = (config.inertial_frame_id, config.body_frame_id)
        variances = (config.attitude_noise_std_rad ** 2, config.rate_noise_std_rad_s ** 2)
        self._outputs = []
        for given in config.state_sinks:
            writer = StateWriter(state_description(given), frames, variances)
            kinds = state_kinds(given, 'state_sinks')
            try:
                writer.fill({topic: kind() for topic, kind in kinds.items()}, _REST)
            except (IndexError, *WRONG_FIELD) as error:
                raise ConfigurationError(
                    'state_sinks', given, f'of fields that can be written ({error})') from None
            self._outputs.append((writer, {
                topic: (kind, node.advertise(kind, topic)) for topic, kind in kinds.items()}))

    def close(self) -> None:
        """Publish no more."""
        for _, topics in self._outputs:
            for _, publisher in topics.values():
                self._node.destroy_lifecycle_publisher(publisher)

    @property
    def readers(self) -> int:
        """The number of subscriptions."""
        return sum(publisher.get_subscription_count()
                   for _, topics in self._outputs for _, publisher in topics.values())

    def send(self, sample: StateSample) -> None:
        """Publish a state."""
        for writer, topics in self._outputs:
            if any(publisher.get_subscription_count() for _, publisher in topics.values()):
                messages = {topic: kind() for topic, (kind, _) in topics.items()}
                writer.fill(messages, sample)
                for topic, (_, publisher) in topics.items():
                    publisher.publish(messages[topic])
