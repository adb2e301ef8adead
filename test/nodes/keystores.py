# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keystores made by the shipped script, with ``ros2 security`` or with a stand-in for it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

SROS2 = Path(__file__).parents[2] / 'config' / 'sros2'
#: What the script asks of ``ros2 security`` and which files it gets; no key is one here.
STAND_IN = """#!{python}
import os, pathlib, secrets, sys
import xml.etree.ElementTree as ET
verb, *rest = sys.argv[2:]
if verb != '--help':
    root = pathlib.Path(rest[0])
    domain = f"<id>{{os.environ['ROS_DOMAIN_ID']}}</id>"
if verb == 'create_keystore':
    for name in ('public', 'private', 'enclaves'):
        (root / name).mkdir(parents=True)
    (root / 'public' / 'ca.cert.pem').write_text(secrets.token_hex())
    (root / 'enclaves' / 'governance.xml').write_text(f'<domains>\\n  {{domain}}\\n</domains>\\n')
elif verb == 'create_enclave':
    folder = root / 'enclaves' / rest[1][1:]
    folder.mkdir(parents=True)
    (folder / 'key.pem').write_text(secrets.token_hex())
    (folder / 'permissions.xml').write_text('<topic>*</topic>')
elif verb == 'create_permission':
    policy = pathlib.Path(rest[2])
    assert ET.parse(policy).find('enclaves/enclave').get('path') == rest[1]
    (root / 'enclaves' / rest[1][1:] / 'permissions.xml').write_text(domain + policy.read_text())
"""


def has_sros2() -> bool:
    """Whether ``ros2 security`` is installed."""
    return shutil.which('ros2') is not None and subprocess.run(
        ['ros2', 'security', '--help'], check=False, capture_output=True).returncode == 0


def stand_in(folder: Path) -> Path:
    """Return a folder with a ``ros2`` that has the command ``security`` alone."""
    folder.mkdir()
    path = folder / 'ros2'
    path.write_text(STAND_IN.format(python=sys.executable), encoding='utf-8')
    path.chmod(0o755)
    return folder


def enforce(
    *arguments: str | Path, domain: int | str = 0, script: Path = SROS2 / 'enforce.sh',
    path: str | None = None,
) -> subprocess.CompletedProcess[str]:
    """Run the script for a domain, with another PATH if one is given."""
    kept = {name: value for name, value in os.environ.items()
            if name not in ('_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'LD_LIBRARY_PATH')
            or '_ROS_WHEELS_BOOTSTRAP_COMPLETE' not in os.environ}
    return subprocess.run(
        ['sh', str(script), *map(str, arguments)], text=True, check=False, capture_output=True,
        timeout=300, env={**kept, 'ROS_DOMAIN_ID': str(domain), 'PATH': path or kept['PATH']})
