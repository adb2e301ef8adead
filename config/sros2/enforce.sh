#!/bin/sh
# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
# Make a keystore with one enclave for each policy in this folder, and say how to use it.
# Needs `ros2 security` (the package sros2) and a middleware built with security.
#
#   ROS_DOMAIN_ID=DOMAIN sh enforce.sh KEYSTORE [/NAMESPACE]
#
# A keystore is for one ROS domain, 0 unless ROS_DOMAIN_ID says another, and may hold several
# spacecraft, each in a namespace: run this once for each. A keystore that is there already keeps
# its authority and its other enclaves; the permissions of these policies are made anew. The work
# is done on a copy: after a failure everything is as it was before.
set -eu

fail() { echo "$0: $1" >&2; exit 1; }
quoted() { printf "'%s'" "$(printf '%s' "$1" | sed "s/'/'\\\\''/g")"; }

case $#${1-} in
    [12][!-]*) ;;
    *) echo "usage: ROS_DOMAIN_ID=DOMAIN sh $0 KEYSTORE [/NAMESPACE]" >&2; exit 2 ;;
esac
namespace=${2-}
[ "$namespace" != / ] || namespace=
printf '%s\n' "$namespace" | grep -Eqx '(/[A-Za-z_][A-Za-z0-9_]*)*' ||
    fail "the namespace '$namespace' is none; like /sat1"
export ROS_DOMAIN_ID="${ROS_DOMAIN_ID:-0}"
printf '%s\n' "$ROS_DOMAIN_ID" | grep -Eqx '0|[1-9][0-9]*' ||
    fail "ROS_DOMAIN_ID is '$ROS_DOMAIN_ID', not the number of a domain"
command -v ros2 > /dev/null || fail 'ros2 is not on the PATH'
ros2 security --help > /dev/null 2>&1 || fail "'ros2 security' (sros2) is missing"
# These programs make keys; they need none themselves.
unset ROS_SECURITY_ENABLE ROS_SECURITY_STRATEGY ROS_SECURITY_KEYSTORE

policies=$(cd "$(dirname "$0")" && pwd)
umask 077
mkdir -p "$(dirname "$1")"
parent=$(cd "$(dirname "$1")" && pwd)
keystore=$parent/$(basename "$1")
aside=$(mktemp -d "$keystore.XXXXXX")
finish() {
    status=$?
    [ -e "$keystore" ] || [ ! -d "$aside/old" ] || mv "$aside/old" "$keystore"
    rm -rf "$aside"
    [ "$status" -eq 0 ] || echo "$0: nothing was changed" >&2
    exit "$status"
}
trap finish EXIT
trap 'exit 130' INT TERM HUP
work=$aside/new

if [ -e "$keystore" ]; then
    governance=$keystore/enclaves/governance.xml
    [ -f "$governance" ] || fail "$keystore is there, and is no keystore"
    made_for=$(sed -n 's|.*<id>\(.*\)</id>.*|\1|p' "$governance")
    [ "$made_for" = "$ROS_DOMAIN_ID" ] || fail "$keystore is for ROS_DOMAIN_ID=$made_for, not \
$ROS_DOMAIN_ID: set that, or make another keystore for this domain"
    cp -RPp "$keystore" "$work"
else
    ros2 security create_keystore "$work"
fi
for policy in "$policies"/*.xml; do
    name=$(basename "$policy" .xml)
    enclave=$namespace/$name
    sed -e "s|<profile ns=\"/\"|<profile ns=\"${namespace:-/}\"|" \
        -e "s|<enclave path=\"/|<enclave path=\"$namespace/|" "$policy" > "$aside/$name.xml"
    [ -d "$work/enclaves$enclave" ] || ros2 security create_enclave "$work" "$enclave"
    ros2 security create_permission "$work" "$enclave" "$aside/$name.xml" ||
        fail "$policy was not accepted"
done
[ ! -e "$keystore" ] || mv "$keystore" "$aside/old"
mv "$work" "$keystore"

remap=${namespace:+ -r __ns:=$namespace}
cat << END

Every process that takes part needs:

  export ROS_DOMAIN_ID=$ROS_DOMAIN_ID
  export ROS_SECURITY_KEYSTORE=$(quoted "$keystore")
  export ROS_SECURITY_ENABLE=true
  export ROS_SECURITY_STRATEGY=Enforce

and its own enclave:

  ros2 run manifold_mpc_ros controller --ros-args --enclave $namespace/attitude_controller -p secure:=true$remap
  ros2 run manifold_mpc_ros simulator --ros-args --enclave $namespace/lgvi_simulator -p secure:=true$remap
  ROS_SECURITY_ENCLAVE_OVERRIDE=$namespace/operator ros2 lifecycle get $namespace/attitude_controller --no-daemon
  ROS_SECURITY_ENCLAVE_OVERRIDE=$namespace/recorder ros2 bag record -a
END
