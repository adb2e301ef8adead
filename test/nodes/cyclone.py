# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Eclipse Cyclone DDS on the loopback, set before its library is loaded: import this first."""

from __future__ import annotations

import os

os.environ['CYCLONEDDS_URI'] = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="true"/>'
    '</Interfaces><AllowMulticast>true</AllowMulticast></General><Discovery><Peers>'
    '<Peer Address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>')

from cyclonedds.core import Policy, Qos
from cyclonedds.util import duration

RELIABLE = Qos(Policy.Reliability.Reliable(duration(milliseconds=10)), Policy.Durability.Volatile,
               Policy.History.KeepLast(10))
