# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Commands that take Ctrl-C even when the tests themselves were started to ignore it."""

from __future__ import annotations

import signal


def take_interrupts() -> None:
    """Restore SIGINT in a child, for ``preexec_fn``: a shell's background jobs ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
