# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The golden bags, for the tests of everything that reads bags."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags import contents, decode
from manifold_mpc_ros.lab.recording.bags.contents import BagTopic
from manifold_mpc_ros.lab.recording.bags.run import read_run
from manifold_mpc_ros.lab.recording.bags.writer import BagWriter
from manifold_mpc_ros.lie import so3

GOLDEN = Path(__file__).parent / 'recording' / 'golden'
NAMES = sorted(path.stem for path in GOLDEN.glob('*.mcap'))
#: The controller of this bag is broken on purpose, and these limits have to say so.
BROKEN = {'mistuned': ['settle_time_s', 'final_error_deg']}


def truncated(name: str, folder: Path) -> Path:
    """Write the beginning of a golden bag, some of its states but not all; return where."""
    data, path = (GOLDEN / f'{name}.mcap').read_bytes(), folder / 'part.mcap'
    whole = len(read_run(GOLDEN / f'{name}.mcap').states)
    for part in range(99, 0, -1):
        path.write_bytes(data[:part * len(data) // 100])
        try:
            if len(read_run(path).states) < whole:
                return path
        except BagError:
            break
    raise AssertionError(f'{name} has all of its states in one chunk')


def with_odometry_setpoint(path: Path) -> Path:
    """Write the golden bag of guidance with an odometry setpoint for its spin; return where."""
    run = read_run(GOLDEN / 'guidance.mcap')
    topic, stamp_ns = run.topics.odometry_setpoint, int(run.references.stamp_ns[1])
    R_ND, omega_DN_D = run.references.trajectories[1].at(stamp_ns)
    w, x, y, z = so3.quaternion_from_rotation(R_ND)
    spin = decode.odometry_cdr(stamp_ns, (x, y, z, w), omega_DN_D, ('inertial', 'base_link'))
    with BagWriter(path) as writer:
        for known in (*run.contents.topics.values(), BagTopic(topic, decode.ODOMETRY)):
            writer.add_topic(known)
        for message in run.contents.messages:
            moved = message.topic == run.topics.reference \
                and contents.stamp_ns_of(message.data) == stamp_ns
            writer.write(replace(message, topic=topic, data=spin) if moved else message)
        writer.add_custom({key: value for key, value in run.contents.custom.items()
                           if key != contents.CUSTOM_CHECKSUMS})
    return path
