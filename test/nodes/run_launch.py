# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run a launch file as ``ros2 launch`` does: ``python run_launch.py FILE NAME:=VALUE ...``."""

from __future__ import annotations

import sys

from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

from launch import LaunchDescription, LaunchService


def main(path: str, *arguments: str) -> int:
    """Run it until everything has ended; return the exit status."""
    service = LaunchService(argv=list(arguments), noninteractive=True)
    service.include_launch_description(LaunchDescription([IncludeLaunchDescription(
        PythonLaunchDescriptionSource(path),
        launch_arguments=[tuple(argument.split(':=', 1)) for argument in arguments])]))
    return int(service.run())


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
