# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Put this folder on the path of the tests, for the draws of `strategies` that they share."""
