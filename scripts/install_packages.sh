#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages of scripts/packages.txt that the machine lacks.
# Usage: scripts/install_packages.sh GROUP...   (build, run, test)
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  echo "This machine has no apt-get: install the equivalents of scripts/packages.txt yourself, then" \
       "set RAYSTAGE_SKIP_INSTALL=1." >&2
  exit 1
fi

wanted() {
  awk -v groups=" $* " '
    /^\[/ { group = substr($1, 2, length($1) - 2); next }
    NF && $1 !~ /^#/ && index(groups, " " group " ") { print $1 }' "$here/packages.txt"
}

missing=()
for package in $(wanted "$@"); do
  status="$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)"
  [ "$status" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

become_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null || ! sudo -v 2>/dev/null; then
    echo "These Debian packages are missing and you may not install them (neither root nor sudo):" >&2
    echo "  apt-get install ${missing[*]}" >&2
    exit 1
  fi
  become_root=(sudo)
fi
echo "Installing ${#missing[@]} Debian packages: ${missing[*]}"
install=("${become_root[@]}" env DEBIAN_FRONTEND=noninteractive
         apt-get install -y -q --no-install-recommends "${missing[@]}")
"${become_root[@]}" apt-get update -q >/dev/null || echo "apt-get update failed; trying all the same" >&2
if ! "${install[@]}" >/dev/null; then
  echo "The packages above could not be installed; see apt-get's message." >&2
  exit 1
fi
