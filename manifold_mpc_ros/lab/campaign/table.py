# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of a campaign as a Parquet file: a row a loop, a function of the plan, bit by bit."""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from manifold_mpc_ros.lab.campaign.case import CaseName
from manifold_mpc_ros.lab.campaign.outcome import TIMES, Outcome
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan

if TYPE_CHECKING:
    import pyarrow as pa

#: The key of the plan, as YAML, in the metadata of the file.
PLAN_KEY = b'manifold_mpc_ros.campaign'
_XYZW = ('x', 'y', 'z', 'w')
#: Names of the columns of the figures with several parts; the others have one, of their name.
COLUMNS: dict[str, tuple[str, ...]] = {
    'largest_torque_n_m': tuple(f'largest_torque_{axis}_n_m' for axis in 'xyz'),
    'largest_rate_rad_s': tuple(f'largest_rate_{axis}_rad_s' for axis in 'xyz'),
    'initial_attitude_xyzw': tuple(f'initial_attitude_{part}' for part in _XYZW),
    'initial_rate_B_rad_s': tuple(f'initial_rate_B_{axis}_rad_s' for axis in 'xyz'),
    'setpoint_xyzw': tuple(f'setpoint_{part}' for part in _XYZW),
    'inertia_kg_m2': tuple(f'inertia_{entry}_kg_m2'
                           for entry in ('xx', 'yy', 'zz', 'xy', 'xz', 'yz')),
    'disturbance_n_m': tuple(f'disturbance_{axis}_n_m' for axis in 'xyz'),
}


def write_table(plan: CampaignPlan, outcomes: Sequence[Outcome], path: Path) -> Path:
    """Write the rows in the order given, all of them or nothing; return where."""
    import pyarrow as pa
    import pyarrow.parquet as parquet
    names = [CaseName.parse(outcome.name) for outcome in outcomes]
    columns: dict[str, pa.Array] = {
        'set': pa.array([name.set_name for name in names], pa.string()),
        'index': pa.array([name.index for name in names], pa.int64())}
    hints = typing.get_type_hints(Outcome)
    for field in dataclasses.fields(Outcome):
        if field.name in TIMES:
            continue
        values = [getattr(outcome, field.name) for outcome in outcomes]
        if field.name in COLUMNS:
            for part, column in enumerate(COLUMNS[field.name]):
                columns[column] = pa.array([value[part] for value in values], pa.float64())
        else:
            columns[field.name] = pa.array(values, _arrow_type(hints[field.name]))
    table = pa.table(columns).replace_schema_metadata({PLAN_KEY: plan.as_yaml().encode()})
    unfinished = path.with_name(path.name + '.part')
    parquet.write_table(table, unfinished, compression='zstd')
    return unfinished.replace(path)


def _arrow_type(hint: Any) -> pa.DataType:
    """Map the type of a figure to that of its column."""
    import pyarrow as pa
    if isinstance(hint, types.UnionType):
        hint = next(part for part in typing.get_args(hint) if part is not types.NoneType)
    if typing.get_origin(hint) is tuple:
        return pa.list_(_arrow_type(typing.get_args(hint)[0]))
    return {str: pa.string(), float: pa.float64(), int: pa.int64(), bool: pa.bool_()}[hint]
