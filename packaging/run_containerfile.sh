#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Executes packaging/Containerfile where no container engine runs, to check it. Each stage has a
# root of its own (debootstrap); COPY, WORKDIR, RUN, USER and ENTRYPOINT are done by cp and chroot.
# Not supported: other instructions. Needs root. A second run continues in the roots of the first.
# Usage: packaging/run_containerfile.sh FOLDER MIRROR [ARGUMENT...]     (of the image's entry point)
set -euo pipefail
source="$(cd "$(dirname "$0")/.." && pwd)"
mkdir -p "$1"
work="$(cd "$1" && pwd)"
mirror="$2"
shift 2
if [ -z "${RAYSTAGE_CONTAINERFILE_MOUNTS:-}" ]; then
  RAYSTAGE_CONTAINERFILE_MOUNTS=1 exec unshare --mount --propagation private "$0" "$work" "$mirror" "$@"
fi

stage=0
root=
folder=/
user=root
entry=()
inside() {  # FOLDER USER COMMAND...
  local at="$1" as="$2"
  shift 2
  env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive \
    chroot "$root" setpriv --reuid="$as" --regid="$as" --clear-groups sh -c 'cd "$1" && shift && exec "$@"' sh "$at" "$@"
}

while IFS= read -r line; do
  echo "== $line"
  read -r instruction rest <<<"$line"
  case "$instruction" in
    FROM)
      stage=$((stage + 1))
      root="$work/stage$stage"
      folder=/ user=root
      [ -e "$root/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$root" "$mirror" >"$work/debootstrap.log"
      cp /etc/resolv.conf "$root/etc/resolv.conf"
      mount -t proc proc "$root/proc"
      [[ $rest != *' AS '* ]] || ln -sfn "stage$stage" "$work/${rest##* AS }"
      ;;
    COPY)
      if [[ $rest == --from=* ]]; then
        read -r from path to <<<"$rest"
        cp -a "$work/${from#--from=}$path" "$root$to"
      else
        read -r path to <<<"$rest"
        mkdir -p "$root$to"
        tar -C "$source/$path" --exclude-from="$source/.containerignore" -c . | tar -C "$root$to" -x
      fi
      ;;
    WORKDIR) folder="$rest" && mkdir -p "$root$folder" ;;
    RUN) inside "$folder" root sh -c "$rest" ;;
    USER) user="$rest" ;;
    LABEL) ;;
    ENTRYPOINT) mapfile -t entry < <(tr -d '[]"' <<<"$rest" | tr ',' '\n' | sed 's/^ *//') ;;
    *) echo "This script does not know $instruction" >&2 && exit 1 ;;
  esac
done < <(sed -e ':join' -e '/\\$/{N;s/\\\n *//;b join' -e '}' "$source/packaging/Containerfile" | grep -v -e '^#' -e '^$')
echo "== ${entry[*]} $* (as $user, in $folder)"
inside "$folder" "$user" "${entry[@]}" "$@"
