# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cones of a recorded run: where each axis pointed, and by how much it kept its cone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config.cones import Between, Cone, between_samples, joined
from manifold_mpc_ros.lab.recording.bags import assemble
from manifold_mpc_ros.lab.recording.bags.run import BagRun
from manifold_mpc_ros.lie.arrays import Array


@dataclass(frozen=True, eq=False)
class ConeHistory:
    """One cone at n states: the unit axis and the direction of the cone, inertial (n, 3)."""

    cone: Cone
    axis_N: Array
    direction_N: Array

    @property
    def cosine(self) -> Array:
        """The cosine between them (n,)."""
        return np.asarray(np.sum(self.axis_N * self.direction_N, axis=1))

    @property
    def angle_rad(self) -> Array:
        """The angle between them (n,) [rad]."""
        return np.asarray(np.arccos(np.clip(self.cosine, -1.0, 1.0)))

    def least_margins_rad(self, between: Sequence[Between]) -> Array:
        """Return by what angle the cone is kept at least between states (n - 1,) [rad].

        ``between`` bounds the motion in each of n - 1 intervals: docs/theory.md (23). A direction
        that came in between is taken for both.
        """
        sign, axis, seen = self.cone.sign, self.axis_N, self.direction_N
        cosines = sign * np.array([np.sum(axis[i] * seen[j], axis=1) for i, j in (
            (slice(None, -1), slice(None, -1)), (slice(1, None), slice(None, -1)),
            (slice(1, None), slice(1, None)))])
        bend, swing = np.array(between).T
        most = cosines.max(axis=0)
        sine = np.where(most >= 0.0, np.sqrt(np.maximum(0.0, 1.0 - most ** 2)), 1.0)
        worst = np.clip(sign * (most + bend + swing * sine), -1.0, 1.0)
        return np.asarray(sign * (np.arccos(worst) - self.cone.half_angle_rad))


def cone_histories(run: BagRun) -> list[ConeHistory]:
    """Return every cone of a run's scenario, with the directions that its topics brought."""
    if run.scenario is None:
        return []
    config, found = run.scenario.controller_config, []
    source = assemble.Source(run.contents, [], [])
    for cone in config.mpc.cones:
        topic, _ = config.cone_topics.get(cone.name, ('', 0.0))
        stamps, directions = source.directions(topic if topic.startswith('/') else f'/{topic}')
        known = np.concatenate([cone.direction_N[None], directions])
        found.append(ConeHistory(cone, run.states.R_NB @ cone.axis_B, known[
            np.searchsorted(stamps, run.states.stamp_ns, side='right')]))
    return found


def least_margins_rad(run: BagRun, histories: Sequence[ConeHistory]) -> dict[str, Array]:
    """Return by what angle each cone or group is kept at least between states (n - 1,) [rad].

    By docs/theory.md (23), with the largest rate that was measured and the controller's limits.
    """
    assert run.scenario is not None
    config = run.scenario.controller_config.mpc
    rate = float(np.linalg.norm(run.states.omega_BN_B, axis=1).max())
    steps = np.diff(run.states.time_s)
    bounds = {step: between_samples(
        config.inertia_kg_m2, config.largest_acceleration_rad_s2, rate, float(step))
        for step in set(np.round(steps, 9))}
    between = [bounds[step] for step in np.round(steps, 9)]
    margins = np.array([each.least_margins_rad(between) for each in histories])
    return joined([each.cone for each in histories], margins)


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
