# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reports of wheel speeds: by name, in any order, none too old."""

from __future__ import annotations

import dataclasses

import numpy as np
from scripted import SAMPLE
from wheel_cases import wheels

from manifold_mpc_ros.control.devices.wheel_reports import WheelReports

TIMEOUT_NS = 10**9
NAMES = ['wheel_3', 'panel', 'wheel_1', 'wheel_2', 'wheel_4']
SPEEDS = [3.0, 100.0, 1.0, 2.0, 4.0]


def test_momenta_are_those_about_the_axes_in_inertial_space() -> None:
    array = wheels()
    reports = WheelReports(array, TIMEOUT_NS)
    reports.receive(SAMPLE.stamp_ns, NAMES, SPEEDS)
    assert reports.speed_rad_s.tolist() == [1.0, 2.0, 3.0, 4.0]
    np.testing.assert_allclose(reports.momenta(SAMPLE), 2e-5 * (
        np.array([1.0, 2.0, 3.0, 4.0]) + array.axes_B @ SAMPLE.omega_BN_B))


def test_what_is_not_reported_is_not_known() -> None:
    reports = WheelReports(wheels(), TIMEOUT_NS)
    assert np.isnan(reports.momenta(SAMPLE)).all()
    reports.receive(SAMPLE.stamp_ns, NAMES[:3], SPEEDS)
    assert np.isnan(reports.momenta(SAMPLE)).tolist() == [False, True, False, True]
    later = dataclasses.replace(SAMPLE, stamp_ns=SAMPLE.stamp_ns + TIMEOUT_NS)
    assert np.isfinite(reports.momenta(later)).sum() == 2
    later = dataclasses.replace(SAMPLE, stamp_ns=SAMPLE.stamp_ns + TIMEOUT_NS + 1)
    assert np.isnan(reports.momenta(later)).all()
    reports.receive(later.stamp_ns, NAMES, SPEEDS)
    assert np.isfinite(reports.momenta(later)).all()
    reports.forget()
    assert np.isnan(reports.momenta(later)).all()
