# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Small campaigns, as mappings that tests change and as plans."""

from __future__ import annotations

from typing import Any

import yaml

from manifold_mpc_ros.lab.campaign.plan import CampaignPlan

FREE = [float('inf')] * 3
#: Without limits the terminal set is nearly everything, and eight steps reach it.
CONTROLLER = {'mpc.horizon': 8, 'limits.max_torque_n_m': FREE,
              'limits.max_rate_rad_s': FREE}
PROMISES = {'promises_broken': 0, 'feasibility_lost': 0, 'limits_exceeded': 0, 'turn_changes': 1}


def mapping(**changed: Any) -> dict[str, Any]:
    """Return a campaign of two sets on the model, as its file has it."""
    return {
        'description': 'a small campaign', 'seed': 0, 'duration_s': 20.0,
        'controller': dict(CONTROLLER), 'simulator': {'plant.step_s': 0.1},
        'acceptance': dict(PROMISES),
        'sets': [
            {'name': 'random', 'loops': 3, 'attitude': {'kind': 'uniform'},
             'rate': {'kind': 'ball', 'largest_rad_s': 0.3}},
            {'name': 'opposite', 'loops': 3, 'attitude': {'kind': 'half_turn'},
             'rate': {'kind': 'rest'}},
        ], **changed}


def plants(**changed: Any) -> dict[str, Any]:
    """Return a set of dispersed bodies."""
    return {
        'name': 'plants', 'loops': 3, 'body': 'plant', 'attitude': {'kind': 'uniform'},
        'rate': {'kind': 'ball', 'largest_rad_s': 0.2}, 'setpoint': {'kind': 'uniform'},
        'inertia': {'moments_part': 0.1, 'axes_deg': 10.0},
        'disturbance': {'largest_n_m': 1e-3, 'frame': 'inertial'},
        'noise': {'attitude_std_rad': [1e-5, 1e-4], 'rate_std_rad_s': [1e-5]}, **changed}


def plan(*sets: dict[str, Any], **changed: Any) -> CampaignPlan:
    """Return that campaign, with other sets where there are any; dotted controller names too."""
    document = mapping()
    for name, value in changed.items():
        document[name] = {**document.get(name, {}), **value} if isinstance(value, dict) else value
    if sets:
        document['sets'] = list(sets)
    return CampaignPlan.from_text(yaml.safe_dump(document), 'small')
