# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rigorous enclosure of the pointing loop on S^2 x SO(3) in ``xi = (E^T x, Log f / h)``.

``Gamma = exp(-hat x) b`` with ``x = E y`` is ``cos t b + sin t / t (b x x)``, and back:
``y = (t / sin t) E^T (Gamma x b)``, ``cos t = b . Gamma``. The step is ``Gamma+ = turn^T Gamma``.
With ``cos(t/2) = sqrt((1 + cos t)/2)`` the same g as for rotations serves: ``t / sin t =
g(cos(t/2)) / (2 cos(t/2))``, singular at the antipode as it should be.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import arb, arb_mat

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics import scalar_form
from manifold_mpc_ros.lab.certification.enclosure import Loop, MeanValueForms
from manifold_mpc_ros.lab.certification.even_functions import (
    angle_over_sine,
    half_cosine,
    half_sine,
    root_of_half,
)
from manifold_mpc_ros.lab.certification.jets import Jet, squared_norm
from manifold_mpc_ros.lab.certification.rigid_body_enclosure import (
    RigidBodyEnclosure,
    block_weight,
    cone_radii,
    triple,
)
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import tangent_basis


class PointingEnclosure:
    """The loop of `pointing_problem` under ``tau = K xi``."""

    dimension = 5

    def __init__(self, config: AttitudeMpcConfig, gain: Array) -> None:
        """Enclose the constants of a configuration and its K (3, 5)."""
        self.body = RigidBodyEnclosure(config, gain)
        self._axis, self._first, self._second = exact_frame(config.pointing_axis_B)
        w = arb(config.pointing_weight)
        self.weight = block_weight(arb_mat(2, 2, [w, 0, 0, w]), self.body)
        self.cone_radii = cone_radii(config)
        self.control_limits = config.max_torque_n_m
        self.control_facets = None if config.wheels is None else config.wheels.torques
        self.chart_radii: Sequence[tuple[int, arb]] = (
            (2, arb.pi()), (3, arb.pi() / self.body.h))

    def check_cost(self) -> str | None:
        """Return why L <= xi^T (lambda W) xi / 2 is not proved, None when it is.

        ``w (1 - cos t) <= w t^2/2``, and the rest as for attitude.
        """
        return self.body.check_cost()

    def advance(self, xi: list[Jet], forms: MeanValueForms) -> Loop:
        """Map the coordinates of a box to the enclosed closed loop."""
        motion = self.body.advance(xi, xi[2:], forms)
        s = squared_norm(xi[:2])
        c, half = half_cosine(s), half_sine(s)
        sinc, cosine = 2 * half * c, 2 * c.square() - 1
        # b x (e1 y1 + e2 y2) = e2 y1 - e1 y2.
        first, second = -sinc * xi[1], sinc * xi[0]
        gamma = triple(cosine * b + first * e + second * f
                       for b, e, f in zip(self._axis, self._first, self._second))
        turned = turn_back(motion.turn, gamma)
        [height] = forms.refine('height', [scalar_form.dot(self._axis, turned)])
        near = root_of_half(height)
        factor = angle_over_sine(near) / (2 * near)
        # Gamma x b = (e1 g1 + e2 g2) x b = -e2 g1 + e1 g2.
        across = [scalar_form.dot(self._second, turned), -scalar_form.dot(self._first, turned)]
        return Loop([*(factor * entry for entry in across), *motion.rate], motion.ratios)


def turn_back(turn: list[Jet], v: scalar_form.Vector) -> scalar_form.Vector:
    """Return ``cay(c)^T v = v - 2/(1 + |c|^2) (c x v - c x (c x v))``."""
    c = triple(turn)
    first = scalar_form.cross(c, v)
    second = scalar_form.cross(c, first)
    scale = 2 / (1 + squared_norm(turn))
    return triple(a - scale * (b - d) for a, b, d in zip(v, first, second))


def exact_frame(axis: Array) -> tuple[scalar_form.Vector, ...]:
    """Return balls that hold an exactly orthonormal b, e1, e2, which the floats are rounded of."""
    b = _unit(triple(map(arb, np.asarray(axis).tolist())))
    given = triple(map(arb, tangent_basis(axis)[:, 0].tolist()))
    first = _unit(scalar_form.add(given, b, -scalar_form.dot(given, b)))
    return b, first, scalar_form.cross(b, first)


def _unit(v: scalar_form.Vector) -> scalar_form.Vector:
    """Return v at length one."""
    length = scalar_form.dot(v, v).sqrt()
    return v[0] / length, v[1] / length, v[2] / length
