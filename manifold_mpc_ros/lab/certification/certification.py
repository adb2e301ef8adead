# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Certify the terminal set of a problem, and re-check a certificate from its file alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.certification.certificate import Certificate
from manifold_mpc_ros.lab.certification.enclosures import design_of, loop_maker
from manifold_mpc_ros.terminal.design import TerminalDesign

# The stored P, K, c are the controller's when they differ by its Riccati solver's rounding only.
_SAME = 1e-8

Progress = Callable[[float, int], None]


def certify_problem(
    kind: str, values: Mapping[str, Any], *, margin: float | None = None, budget: int = 200_000,
    workers: int = 1, progress: Progress | None = None, design: TerminalDesign | None = None,
) -> Certificate:
    """Design the terminal set of a described problem and prove as much of it as can be.

    ``margin`` is `default_margin` unless given; ``design`` replaces the problem's own (any P, K, c
    may be put to the proof). Raises what the design raises. Needs python-flint.
    """
    from manifold_mpc_ros.lab.certification.certify import prove
    chosen = design_of(kind, values) if design is None else design
    if margin is None:
        margin = default_margin(values)
    proof = prove(loop_maker(kind, values, chosen.K), chosen.P, chosen.K, chosen.c, margin=margin,
                  budget=budget, workers=workers, progress=progress)
    cover = proof.cover
    evidence: dict[str, Any] = {
        'reason': proof.reason,
        'closed_form_levels': proof.limits,
        'linear_bound': proof.linear_bound if np.isfinite(proof.linear_bound) else None,
        'largest_ratios': dict(cover.ratios),
        'boxes_verified': cover.verified, 'boxes_outside': cover.outside,
        'boxes_split': cover.split, 'depth': cover.depth, 'boxes_of_all_attempts': proof.boxes,
        'sampled_worst_decrease': chosen.report.worst_decrease,
    }
    return Certificate(kind, dict(values), chosen.P, chosen.K, chosen.c, proof.level, margin,
                       evidence)


def default_margin(values: Mapping[str, Any]) -> float:
    """Return the margin asked for when none is: 0.1, or half of what lambda leaves if less.

    Near the equilibrium F decreases by L / lambda, a margin of 1/lambda - 1.
    """
    return min(0.1, (1 / float(values.get('terminal_scale', 0.9)) - 1) / 2)


def recheck(certificate: Certificate, *, budget: int = 400_000, workers: int = 1,
            progress: Progress | None = None) -> None:
    """Prove the claim of a certificate again, from its problem, P, K and level alone.

    Raises ManifoldMpcError with the reason, when P, K or c are not those of the stored problem, or
    the claim cannot be proved.
    """
    from manifold_mpc_ros.lab.certification.certify import prove
    kind, values = certificate.problem, certificate.configuration
    if not certificate.certified_level > 0:
        raise ManifoldMpcError('refused: the certificate claims nothing')
    make_loop = loop_maker(kind, values, certificate.K)
    design = design_of(kind, values)
    for name in ('P', 'K'):
        stored, own = getattr(certificate, name), getattr(design, name)
        if stored.shape != own.shape or np.abs(stored - own).max() > _SAME * np.abs(own).max():
            raise ManifoldMpcError(f'refused: {name} is not the one of the stored configuration')
    most = design.c * (1 + 1e-3)
    if not certificate.certified_level <= certificate.design_level <= most:
        raise ManifoldMpcError(
            f'refused: the levels {certificate.certified_level:.6g} and '
            f'{certificate.design_level:.6g} do not fit the c of the stored configuration, '
            f'{design.c:.6g}')
    proof = prove(make_loop, certificate.P, certificate.K, certificate.certified_level,
                  margin=certificate.margin, budget=budget, workers=workers, smaller=False,
                  progress=progress)
    if not proof.complete:
        raise ManifoldMpcError(f'refused: not proved up to c = {certificate.certified_level:.6g}: '
                               f'{proof.reason}')
