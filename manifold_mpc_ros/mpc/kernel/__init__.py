# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The local solver: phases over the horizon, as generated C or in CasADi's virtual machine."""
