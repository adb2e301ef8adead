# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers as the tables on the terminal have them."""

from __future__ import annotations

import math

from manifold_mpc_ros.cli.console import vector_text


def test_rounding_beside_the_largest_is_zero_and_little_else() -> None:
    assert vector_text([6e-21, -1e-20, 0.3], 'N m') == '(0, 0, 0.3) N m'
    assert vector_text([1e-9, -1e-20]) == '(1e-09, -1e-20)'
    assert vector_text([math.inf, 0.3, math.nan]) == '(inf, 0.3, nan)'
