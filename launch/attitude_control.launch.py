# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Start the attitude controller, and a simulated spacecraft unless there is a real one.

ros2 launch manifold_mpc_ros attitude_control.launch.py namespace:=sat1 with_simulator:=false
"""

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription

PACKAGE = 'manifold_mpc_ros'
RESPAWN_DELAY_S = 0.5


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and both nodes; the nodes configure and activate themselves."""
    simulated_time = ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
    return LaunchDescription([
        DeclareLaunchArgument(
            'namespace', default_value='', description='namespace of both nodes'),
        DeclareLaunchArgument(
            'controller_params', default_value=_shipped('controller.yaml'),
            description='parameter file of the controller'),
        DeclareLaunchArgument(
            'simulator_params', default_value=_shipped('simulator.yaml'),
            description='parameter file of the simulator'),
        DeclareLaunchArgument(
            'use_sim_time', default_value='false',
            description='the controller follows /clock, and the simulator publishes it'),
        DeclareLaunchArgument(
            'with_simulator', default_value='true',
            description='start the simulated spacecraft too'),
        DeclareLaunchArgument(
            'respawn', default_value='false',
            description='start a node again when it has ended'),
        Node(
            package=PACKAGE, executable='controller', output='screen',
            respawn=LaunchConfiguration('respawn'), respawn_delay=RESPAWN_DELAY_S,
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('controller_params'),
                        {'use_sim_time': simulated_time}]),
        Node(
            package=PACKAGE, executable='simulator', output='screen',
            respawn=LaunchConfiguration('respawn'), respawn_delay=RESPAWN_DELAY_S,
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('simulator_params'),
                        {'timing.publish_clock': simulated_time}],
            condition=IfCondition(LaunchConfiguration('with_simulator'))),
    ])


def _shipped(name: str) -> PathJoinSubstitution:
    """Return the path of a parameter file of this package."""
    return PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', name])
