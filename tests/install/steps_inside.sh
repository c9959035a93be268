#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tests the installed commands. install_test.sh runs it inside the root with the package; it writes
# its files to /work.
set -euo pipefail
cd /work
fail() { echo "FAILED: $1" >&2; exit 1; }

raystage --version
[ "$(raystage --version | head -n 1)" = "raystage $(dpkg-query -W -f '${Version}' raystage)" ] || fail "the version"

# Every command runs, has its man page, and finds all of its libraries.
listed() { awk '/^(Commands|Subcommands):/ { list = 1; next } list && /^  [a-z]/ { print $1; next } !/^ / { list = 0 }'; }
pages=0
check_command() {
  local page child
  page="$(IFS=-; echo "raystage${*:+-}$*")"
  zcat "/usr/share/man/man1/$page.1.gz" | grep -q '^\.SH SYNOPSIS' || fail "no man page $page"
  pages=$((pages + 1))
  for child in $(raystage "$@" --help | listed); do
    check_command "$@" "$child"
  done
}
check_command
[ "$pages" -gt 15 ] || fail "only $pages commands are found in the help"
for program in /usr/bin/raystage* /usr/lib/raystage/*.so; do
  if ldd "$program" | grep 'not found'; then fail "$program lacks libraries"; fi
done
echo "$pages commands have their man pages; all libraries are found"

raystage simulate -o take --rows 3 --columns 3 --seconds 2 --shot-frames 2 --width 160 --height 120 -q
raystage sync take -q
raystage verify take -q >/dev/null
raystage bag take -o bag -q >/dev/null
raystage bag --check checksums bag -q >/dev/null
[ -s bag/representation/formats/archive.md ] && [ -s bag/representation/reader/read_take.py ] || fail "the bag lacks descriptions"
raystage render take/shot.json -o frames/shot.####.exr -q
raystage preview frames/shot.####.exr -o preview.mp4 --contact-sheet sheet.png -q >/dev/null
[ -s preview.mp4 ] && [ -s sheet.png ] || fail "no preview"

# Render an example shot with textures, which loads a module at run time.
cp -r /usr/share/doc/raystage/docs/shots .
sed -e 's#takes/stage#../take#' shots/reflection_by_map.json >shots/textured.json
raystage render shots/textured.json -o frames/textured.####.exr --frames 1-2 -q

# Record from a source of libavdevice, which no executable links.
cat >node.json <<'JSON'
{"schema": "raystage/record/1", "name": "devices", "memory_mb": 100,
 "cameras": [{"id": "a", "ffmpeg": {"url": "lavfi:testsrc=size=96x64:rate=30:duration=1"}}]}
JSON
raystage record node.json -o recorded -q >/dev/null
raystage verify recorded -q >/dev/null

# Test the completion as bash loads it.
. /usr/share/bash-completion/bash_completion
_completion_loader raystage || true
completions() {
  COMP_LINE="$1" COMP_POINT=${#1} COMPREPLY=()
  read -ra COMP_WORDS <<<"$1"
  [[ $1 != *' ' ]] || COMP_WORDS+=('')
  COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
  _raystage raystage
  echo "${COMPREPLY[*]}"
}
expect_completion() {
  [ "$(completions "$1")" = "$2" ] || fail "completion of '$1': $(completions "$1"); expected: $2"
}
set +eu
expect_completion 'raystage ' "$(raystage --help | listed | xargs)"
expect_completion 'raystage calibrate le' lens
expect_completion 'raystage calibrate lens --boa' --board
expect_completion 'raystage render --existing ' 'error overwrite skip'
expect_completion 'raystage render node' node.json
echo "completion works"
