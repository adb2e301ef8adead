# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rigorous enclosure of the attitude loop on SO(3) x SO(3) in ``xi = (Log g, Log f / h)``.

The product ``g+ = g turn`` is taken of quaternions from ``w = cos(|x|/2)`` on and its logarithm is
continued past 180 degrees, so the enclosed loop is smooth wherever ``|x+| < 2 pi``. It is the
plant's loop where ``|x+| < pi``, and a certificate shows that: the continued loop stays in X_T,
which lies inside the chart.
"""

from __future__ import annotations

from collections.abc import Sequence

from flint import arb

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics import scalar_form
from manifold_mpc_ros.lab.certification.enclosure import Loop, MeanValueForms, is_positive_definite
from manifold_mpc_ros.lab.certification.even_functions import (
    angle_over_sine,
    half_cosine,
    half_sine,
    inverse_root,
)
from manifold_mpc_ros.lab.certification.jets import Jet, chain, coordinates, squared_norm
from manifold_mpc_ros.lab.certification.rigid_body_enclosure import (
    RigidBodyEnclosure,
    block_weight,
    cone_radii,
    trace_hessian,
    triple,
)
from manifold_mpc_ros.lie.arrays import Array


class AttitudeEnclosure:
    """The loop of `attitude_problem` under ``tau = K xi``."""

    dimension = 6

    def __init__(self, config: AttitudeMpcConfig, gain: Array) -> None:
        """Enclose the constants of a configuration and its K (3, 6)."""
        self.body = RigidBodyEnclosure(config, gain)
        self._attitude = trace_hessian(config.attitude_weight)
        self.weight = block_weight(self._attitude, self.body)
        self.cone_radii = cone_radii(config)
        self.control_limits = config.max_torque_n_m
        self.control_facets = None if config.wheels is None else config.wheels.torques
        self.chart_radii: Sequence[tuple[int, arb]] = (
            (3, arb.pi()), (3, arb.pi() / self.body.h))

    def check_cost(self) -> str | None:
        """Return why L <= xi^T (lambda W) xi / 2 is not proved, None when it is.

        ``tr(Q (I - exp(hat x))) = (1 - cos t)/t^2 x^T (tr(Q) I - Q) x`` and
        ``1 - cos t <= t^2/2``: it holds when ``tr(Q) I - Q`` is positive definite.
        """
        if not is_positive_definite(self._attitude):
            return 'tr(Qg) I - Qg is not provably positive definite'
        return self.body.check_cost()

    def advance(self, xi: list[Jet], forms: MeanValueForms) -> Loop:
        """Map the coordinates of a box to the enclosed closed loop."""
        motion = self.body.advance(xi, xi[3:], forms)
        x, c = triple(xi[:3]), triple(motion.turn)
        inner = [squared_norm(xi[:3]), squared_norm(motion.turn), scalar_form.dot(x, c)]
        along, turned, across = (chain(outer, inner) for outer in _product(
            coordinates([jet.value for jet in inner], inner[0].second)))
        normal = scalar_form.cross(x, c)
        attitude = [along * a + turned * b + across * n for a, b, n in zip(x, c, normal)]
        return Loop([*attitude, *motion.rate], motion.ratios)


def _product(inner: list[Jet]) -> tuple[Jet, Jet, Jet]:
    """Map ``(|x|^2, |c|^2, x . c)`` to the three factors of ``Log(exp(x) cay(c))``.

    With ``n = 1/sqrt(1 + |c|^2)`` and ``w+ = n (C - S x . c)`` they are
    ``g(w+) n`` times S, C and S.
    Three variables only: what cancels in the product's second derivatives cancels here already.
    """
    s, q, p = inner
    cosine, half, norm = half_cosine(s), half_sine(s), inverse_root(q)
    factor = angle_over_sine(norm * (cosine - half * p)) * norm
    across = factor * half
    return across, factor * cosine, across
