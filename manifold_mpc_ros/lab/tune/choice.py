# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller that the rule gives for a body: the damping whose worst slew is the quickest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.lab.batch.model_loop import LoopingMpc
from manifold_mpc_ros.lab.tune import rule, trial
from manifold_mpc_ros.lab.tune.rule import Timing, Weights
from manifold_mpc_ros.lab.tune.trial import Outcome, Slew

# Dampings that are tried.
DAMPINGS = (0.015, 0.02, 0.03, 0.05, 0.08)


class Trial(NamedTuple):
    """One choice of weights, the parameters it gives, and how it flew."""

    weights: Weights
    chosen: dict[str, Value]
    mpc: LoopingMpc
    outcomes: list[Outcome]

    @property
    def hardest(self) -> Outcome:
        """The slew that settles latest against its bound."""
        return max(self.outcomes, key=lambda outcome: outcome.ratio)


def try_dampings(values: Mapping[str, Value], effort: float, accuracy_rad: float,
                 slews: Sequence[Slew], step_s: float | None = None,
                 on_trial: Callable[[float], object] = bool) -> list[Trial]:
    """Fly every slew with every damping; full torque costs ``effort`` times the accuracy."""
    trials = []
    for damping in DAMPINGS:
        on_trial(damping)
        weights = Weights(effort * accuracy_rad, damping)
        timing, half_turn = rule.timing_of(values, weights, step_s)
        trials.append(fly(values, timing, weights, half_turn, slews, accuracy_rad))
    return trials


def best_of(trials: Sequence[Trial]) -> Trial:
    """Return the trial whose worst ratio is least; of equals within a percent the most damped."""
    return min(trials, key=lambda each: (
        round(trial.worst_ratio(each.outcomes), 2), -each.weights.damping))


def fly(values: Mapping[str, Value], timing: Timing, weights: Weights, half_turn: float,
        slews: Sequence[Slew], accuracy_rad: float) -> Trial:
    """Build one controller and fly every slew."""
    chosen, config = rule.controller(values, timing, weights, half_turn)
    mpc = LoopingMpc(config)
    return Trial(weights, chosen, mpc, trial.fly(mpc, slews, accuracy_rad))
