# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of ROS's log files, looked at before ROS does, which ends the process without one."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

#: ROS arguments that leave log files out; lines still go to the console and to /rosout.
NO_LOG_FILE = ('--ros-args', '--disable-external-lib-logs')


def why_no_log_file(environment: Mapping[str, str]) -> str:
    """Return in a sentence why ROS could write no log file, '' where it can.

    The folder is $ROS_LOG_DIR, else $ROS_HOME/log, else ~/.ros/log, with ~ as $HOME has it.
    """
    home = environment.get('HOME', '')
    given = environment.get('ROS_LOG_DIR') or f'{environment.get("ROS_HOME") or "~/.ros"}/log'
    if given.startswith('~') and not home:
        return 'no log file: HOME is not set; ROS_LOG_DIR names a folder for it'
    path = Path(home + given[1:] if given.startswith('~') else given)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            return ''
    except OSError as error:
        return f'no log file: {path}: {error.strerror}; ROS_LOG_DIR names another folder for it'
