# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether DDS security is enforced for this process, as ROS 2 (rcl) reads its environment.

With security enabled and enforced, rcl makes no node without valid keys, and neither does a
middleware that was built without security: a node that exists in such an environment is secure.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from manifold_mpc_ros.errors import ConfigurationError

ENABLE, STRATEGY = 'ROS_SECURITY_ENABLE', 'ROS_SECURITY_STRATEGY'
KEYSTORE = 'ROS_SECURITY_KEYSTORE'
#: What rcl compares with, to the letter.
_WANTED = {ENABLE: 'true', STRATEGY: 'Enforce'}


def demand_enforcement(environment: Mapping[str, str], node: str) -> None:
    """Raise ConfigurationError unless rcl enforced security when it made this process's node."""
    for name, wanted in _WANTED.items():
        found = environment.get(name, '')
        if found != wanted:
            raise ConfigurationError(
                'secure', True, f'false, or {name}={wanted} in the environment of {node} '
                f'(it is {found!r}; docs/security.md)')
    demand_keystore(environment)


def demand_keystore(environment: Mapping[str, str]) -> None:
    """Raise ConfigurationError where rcl will look for a keystore and none is named.

    rcl itself ends without a reason then ("error not set", rcl 9.2).
    """
    keystore = environment.get(KEYSTORE, '')
    enforced = all(environment.get(name) == wanted for name, wanted in _WANTED.items())
    if enforced and not (Path(keystore) / 'enclaves').is_dir():
        raise ConfigurationError(
            KEYSTORE, keystore, 'a keystore, which has a folder enclaves, while '
            f'{ENABLE}=true and {STRATEGY}=Enforce (docs/security.md)')
