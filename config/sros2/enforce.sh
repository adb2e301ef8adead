#!/bin/sh
# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
# Make a keystore with one enclave for each policy in this folder, and say how to use it.
# Needs `ros2 security` (the package sros2) and a middleware built with security.
#
#   sh enforce.sh KEYSTORE
#
# A keystore that is there already is kept: its authority goes on, permissions are made anew.
set -eu

[ $# -eq 1 ] || { echo "usage: sh $0 KEYSTORE" >&2; exit 2; }
command -v ros2 > /dev/null || { echo "$0: ros2 is not on the PATH" >&2; exit 1; }
ros2 security --help > /dev/null 2>&1 || { echo "$0: 'ros2 security' (sros2) is missing" >&2; exit 1; }

policies=$(cd "$(dirname "$0")" && pwd)
umask 077
[ -d "$1/enclaves" ] || ros2 security create_keystore "$1"
keystore=$(cd "$1" && pwd)
for policy in "$policies"/*.xml; do
    enclave=/$(basename "$policy" .xml)
    [ -d "$keystore/enclaves$enclave" ] || ros2 security create_enclave "$keystore" "$enclave"
    ros2 security create_permission "$keystore" "$enclave" "$policy"
done

cat << END

Every process that takes part needs:

  export ROS_SECURITY_KEYSTORE=$keystore
  export ROS_SECURITY_ENABLE=true
  export ROS_SECURITY_STRATEGY=Enforce

and its own enclave:

  ros2 run manifold_mpc_ros controller --ros-args --enclave /attitude_controller -p secure:=true
  ros2 run manifold_mpc_ros simulator --ros-args --enclave /lgvi_simulator -p secure:=true
END
