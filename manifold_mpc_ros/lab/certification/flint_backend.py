# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The one door to python-flint, the ball arithmetic (Arb) that certificates are computed in.

Only the modules of the certificates import this one, and the verbs import those when they run,
so the rest of the package works without it.
"""

from __future__ import annotations

from manifold_mpc_ros.errors import ManifoldMpcError

try:
    from flint import arb, arb_mat
except ImportError as missing:
    raise ManifoldMpcError(
        'rigorous certificates need the package python-flint, which is not installed: '
        "run 'pip install python-flint'") from missing

__all__ = ['arb', 'arb_mat']
