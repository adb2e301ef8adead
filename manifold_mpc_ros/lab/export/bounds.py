# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What one call of the C controller does at most, counted in the generated code."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.mpc import search
from manifold_mpc_ros.mpc.program import options
from manifold_mpc_ros.mpc.program.phase import Phase, Structure
from manifold_mpc_ros.mpc.program.program import program_of


class Bounds(NamedTuple):
    """Of one call: passes, trials of a pass, roll-outs of starts; statements of each; of all."""

    passes: int
    trials: int
    starts: int
    model: int
    trial: int
    start: int
    total: int


def statements(phases: Iterable[Phase], horizon: int) -> int:
    """Return how many statements of the generated code phases execute: one a line."""
    return sum(len(phase.stages(horizon)) * phase.function.n_instructions() for phase in phases)


def bounds(structure: Structure, config: AttitudeMpcConfig) -> Bounds:
    """Count along search.c: what `find` calls at most, and what each call runs at most."""
    program, n = program_of(structure), config.horizon
    count = len(search.starts(config))
    improvements = [most for _, most in options.WARM_STARTS]
    # With the terminal set: improve, search with it, search without, bend (improve, search all),
    # improve without it, search without it. Without: improve, search, improve, search.
    improved, searched = (3, 4) if config.terminal_constraint else (2, 2)
    passes = improved * sum(improvements) + searched * count * options.MOST_PASSES
    trials = math.floor(-math.log(options.SMALLEST_STEP) / -math.log(options.BACKTRACK)) + 1
    starts = improved * len(improvements) + searched * (count + 1)
    model = statements(program.backward, n)
    trial = statements(program.trial_step, n)
    start = max(statements((*program.slew, *program.cold), n),
                statements((*program.shift, *program.warm), n))
    others = statements((*program.set_state, *program.report, *program.poses), n)
    return Bounds(passes, trials, starts, model, trial, start, passes * (model + trials * trial)
                  + starts * start + (searched + improved) * others)


def bounds_of(structure: Structure, config: AttitudeMpcConfig) -> dict[str, str]:
    """Return the bounds as the README words them."""
    found = bounds(structure, config)
    return {name.upper(): f'{value:,}' for name, value in found._asdict().items()}
