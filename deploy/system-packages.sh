#!/bin/sh
# Installs the system packages of system-packages.txt that are missing; without the right to, prints the one line to run.
set -eu
here=$(dirname "$0")
packages=$(grep -v '^#' "$here/system-packages.txt" | awk '{print $1}')

if ! command -v dpkg-query >/dev/null 2>&1; then
    echo "not a Debian: make sure that these (or their like) are installed:" $packages >&2
    exit 0
fi
missing=""
for package in $packages; do
    dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

line="apt-get update && apt-get install -y --no-install-recommends$missing"
if [ "$(id -u)" = 0 ]; then
    as_root=""
elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
    as_root="sudo"
else
    echo "missing system packages; run this as root, then try again:" >&2
    echo "  $line" >&2
    exit 1
fi
export DEBIAN_FRONTEND=noninteractive
$as_root apt-get -qq update
$as_root apt-get -qq install -y --no-install-recommends $missing >/dev/null
