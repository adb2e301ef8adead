# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cones of a recorded run: where each axis pointed, and by how much it kept its cone."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from manifold_mpc_ros.config.cones import between_samples
from manifold_mpc_ros.control.moving.directions import ConeDirections
from manifold_mpc_ros.lab.recording.bags import assemble
from manifold_mpc_ros.lab.recording.bags.run import BagRun
from manifold_mpc_ros.lab.reference import cone_history
from manifold_mpc_ros.lab.reference.cone_history import ConeHistory
from manifold_mpc_ros.lie.arrays import Array


def cone_histories(run: BagRun) -> list[ConeHistory]:
    """Return every cone of a run's scenario, with the directions that its topics brought.

    These go on between messages as the controller has it.
    """
    if run.scenario is None:
        return []
    config, found = run.scenario.controller_config, []
    source = assemble.Source(run.contents, [], [])
    for cone in config.mpc.cones:
        topic, _ = config.cone_topics.get(cone.name, ('', 0.0))
        stamps, directions = source.directions(topic if topic.startswith('/') else f'/{topic}')
        messages, known = deque(zip(stamps.tolist(), directions)), ConeDirections(config.mpc)
        seen = []
        for time_ns in run.states.stamp_ns.tolist():
            while messages and messages[0][0] <= time_ns:
                stamp_ns, direction_N = messages.popleft()
                known.take(cone.name, direction_N, stamp_ns)
            seen.append(known.at(time_ns).get(cone.name, cone.direction_N))
        found.append(ConeHistory(cone, run.states.R_NB @ cone.axis_B, np.array(seen)))
    return found


def least_margins_rad(run: BagRun, histories: Sequence[ConeHistory]) -> dict[str, Array]:
    """Return by what angle each cone or group is kept at least between states (n - 1,) [rad].

    By the largest rate that was measured and the controller's limits.
    """
    assert run.scenario is not None
    config = run.scenario.controller_config.mpc
    rate = float(np.linalg.norm(run.states.omega_BN_B, axis=1).max())
    steps = np.diff(run.states.time_s)
    bounds = {step: between_samples(
        config.inertia_kg_m2, config.largest_acceleration_rad_s2, rate, float(step))
        for step in set(np.round(steps, 9))}
    between = [bounds[step] for step in np.round(steps, 9)]
    return cone_history.least_margins_rad(histories, between)


def violated_s(run: BagRun) -> tuple[float, str, float] | None:
    """Return how long some cone is not kept for sure [s], the worst one and its least margin.

    The margin is in rad; None where there are no cones.
    """
    histories = cone_histories(run)
    if not histories or len(run.states) < 2:
        return None
    margins = least_margins_rad(run, histories)
    worst = min(margins, key=lambda name: float(margins[name].min()))
    violated = np.any([each < 0.0 for each in margins.values()], axis=0)
    return (float(np.diff(run.states.time_s)[violated].sum()), worst, float(margins[worst].min()))
