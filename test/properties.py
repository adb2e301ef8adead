# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How properties are run, and draws of anything that a message may hold."""

from __future__ import annotations

import math
import os

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from strategies import Array, drawn_rotation_vectors

from manifold_mpc_ros.lie import so3

#: Every property is tried on this many examples, the same ones in every run; 2,000 with
#: `make test-properties`.
EXAMPLES = int(os.environ.get('PROPERTY_EXAMPLES', '500'))
PROPERTY = settings(
    max_examples=EXAMPLES, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])

#: Numbers as they come out of a message: NaN, infinities, denormals and huge ones among them.
any_float = st.floats(width=64) | st.sampled_from(
    [0.0, -0.0, 1.0, -1.0, math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324])
any_vector = st.tuples(any_float, any_float, any_float)
finite_vector = st.tuples(*[st.floats(-1e3, 1e3)] * 3)
any_text = st.text(max_size=12) | st.sampled_from(['', 'inertial', 'base_link', 'odom'])


def rotations() -> st.SearchStrategy[Array]:
    """Draw rotations of every stratum, near 0 and near 180 degrees among them."""
    return drawn_rotation_vectors().map(so3.exp)


@st.composite
def quaternions(draw: st.DrawFn) -> tuple[float, float, float, float]:
    """Draw x, y, z, w: unit ones of either sign, ones nearly so, and anything."""
    if draw(st.booleans()):
        return draw(st.tuples(any_float, any_float, any_float, any_float))
    w, x, y, z = so3.quaternion_from_rotation(draw(rotations()))
    scale = draw(st.sampled_from([1.0, -1.0, 1.009, -0.991, 1.02, 0.98]))
    return (scale * float(x), scale * float(y), scale * float(z), scale * float(w))


def is_rotation_matrix(R: Array) -> bool:
    """Whether a matrix is finite, orthonormal to rounding, and right-handed."""
    return bool(np.isfinite(R).all()) and so3.is_rotation(R, 1e-12)
