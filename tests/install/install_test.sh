#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian package into an empty root (debootstrap, then apt-get in a chroot) with only
# its declared dependencies. Then runs the demo's main steps by the installed commands. Frames must
# be byte-identical to those of the build folder's commands.
# Usage: install_test.sh BUILD_FOLDER      exit code 77: skipped, with the reason on stdout
set -euo pipefail
build="$(cd "$1" && pwd)"
archives=/var/cache/apt/archives
say() { printf '%4ss  %s\n' "$SECONDS" "$1"; }
skip() { echo "SKIP: $1"; exit 77; }
fail() { echo "FAILED: $1" >&2; exit 1; }

[ "$(id -u)" -eq 0 ] || skip "only root may make a root folder and change into it"
for program in debootstrap unshare apt-get dpkg-shlibdeps file help2man; do
  command -v "$program" >/dev/null || skip "$program is not installed (scripts/packages.txt)"
done
if [ -z "${RAYSTAGE_INSTALL_TEST_MOUNTS:-}" ]; then
  unshare --mount true 2>/dev/null || skip "this machine allows no mounts of a process's own"
  RAYSTAGE_INSTALL_TEST_MOUNTS=1 exec unshare --mount --propagation private "$0" "$@"
fi
suite="$(. /etc/os-release && [ "$ID" = debian ] && echo "$VERSION_CODENAME" || true)"
[ -n "$suite" ] || skip "this machine's system is not Debian"
# Use the mirror of this machine's apt.
mirror="$(apt-get indextargets --format '$(ORIGIN) $(CODENAME) $(REPO_URI)' 'Created-By: Packages' |
          awk -v suite="$suite" '$1 == "Debian" && $2 == suite { sub("/$", "", $3); print $3; exit }')"
[ -n "$mirror" ] || skip "apt has no package lists of Debian $suite (apt-get update)"

work="$build/install_test"
root="$work/root"
# Mounts are in a private namespace, so that a killed run leaves none.
clear_work() {
  umount -q "$root/proc" "$root$archives" 2>/dev/null || true
  rm -rf --one-file-system "$work"
}
clear_work
mkdir -p "$work/archives/partial" "$root"
trap clear_work EXIT
mknod "$work/null" c 1 3 2>/dev/null && echo 2>/dev/null >"$work/null" || skip "this machine allows no device files"
/usr/lib/apt/apt-helper -o APT::Sandbox::User=root download-file "$mirror/dists/$suite/InRelease" "$work/InRelease" >/dev/null 2>&1 ||
  skip "the Debian mirror of this machine's apt cannot be reached"

say "package"
# The default compression of the package, xz, takes half a minute.
(cd "$build" && cpack -G DEB -B "$work/package" -D CPACK_DEBIAN_COMPRESSION_TYPE=gzip >"$work/cpack.log" 2>&1) ||
  { cat "$work/cpack.log"; fail "cpack"; }
package="$(echo "$work"/package/*.deb)"
dpkg-deb -f "$package" Package Version Depends

say "empty root"
# Uses the packages in apt's cache but adds none, because this machine's apt may be running.
cp -al "$archives"/*.deb "$work/archives/" 2>/dev/null || cp -a "$archives"/*.deb "$work/archives/" 2>/dev/null || true
debootstrap --variant=minbase --cache-dir="$work/archives" "$suite" "$root" "$mirror" >"$work/debootstrap.log" 2>&1 ||
  { tail "$work/debootstrap.log"; fail "debootstrap"; }

say "apt-get install"
# Use all suites of this machine's Debian mirror, for the same versions.
rm -f "$root"/etc/apt/sources.list
apt-get indextargets --format '$(ORIGIN) $(REPO_URI) $(CODENAME)' 'Created-By: Packages' |
  awk -v suite="$suite" '$1 == "Debian" && index($3, suite) == 1 { print "deb", $2, $3, "main" }' |
  sort -u >"$root/etc/apt/sources.list.d/debian.list"
cp /etc/resolv.conf "$root/etc/resolv.conf"
cp "$package" "$root/raystage.deb"
# Omit man pages and translations of other packages.
printf 'path-exclude=%s\n' '/usr/share/doc/*' '/usr/share/man/*' '/usr/share/locale/*' >"$root/etc/dpkg/dpkg.cfg.d/lean"
printf 'path-include=%s\n' '/usr/share/doc/raystage/*' '/usr/share/man/man1/raystage*' >>"$root/etc/dpkg/dpkg.cfg.d/lean"
echo force-unsafe-io >>"$root/etc/dpkg/dpkg.cfg.d/lean"
mount -t proc proc "$root/proc"
mkdir -p "$root$archives"
mount --bind "$work/archives" "$root$archives"
inside() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/ LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive chroot "$@"; }
options=(-o APT::Sandbox::User=root -o Acquire::Languages=none -y -q --no-install-recommends)
for arguments in update "install /raystage.deb bash-completion"; do
  # shellcheck disable=SC2086
  inside "$root" apt-get "${options[@]}" $arguments >"$work/apt.log" 2>&1 ||
    { tail -n 30 "$work/apt.log"; fail "apt-get $arguments"; }
done
dpkg-query --admindir="$root/var/lib/dpkg" -W | wc -l | sed 's/$/ packages installed/'

say "the demo's steps, by the installed commands, as nobody"
mkdir -m 777 "$root/work"
cp "$(dirname "$0")/steps_inside.sh" "$root/work/"
inside --userspec=nobody:nogroup "$root" bash /work/steps_inside.sh || fail "a step above"

say "the same frames by the build folder's commands"
frames=0
for shot in take/shot shots/textured; do
  name="$(basename "$shot")"
  "$build/bin/raystage" render "$root/work/$shot.json" -o "$work/here/$name.####.exr" --frames 1-2 -q \
    2>>"$work/render.log" || { cat "$work/render.log"; fail "render $shot.json"; }
done
for frame in "$work"/here/*.exr; do
  cmp "$frame" "$root/work/frames/$(basename "$frame")" || fail "frames differ"
  frames=$((frames + 1))
done
[ "$frames" -eq 4 ] || fail "$frames of 4 frames are there"

say "an installation below another prefix, run through a symbolic link"
DESTDIR="$work/staged" cmake --install "$build" --prefix /opt/raystage >/dev/null
ln -s opt/raystage/bin "$work/staged/tools"
"$work/staged/tools/raystage" render "$root/work/shots/textured.json" -o "$work/textured.####.exr" --frames 1 -q \
  2>>"$work/render.log" || { cat "$work/render.log"; fail "render from another prefix"; }
cmp "$work/textured.0001.exr" "$work/here/textured.0001.exr" || fail "frames differ"
[ "$(cd "$work/staged" && echo * opt/*)" = "opt tools opt/raystage" ] || fail "files outside of the prefix"
say "done: debootstrap and apt-get in a chroot"
