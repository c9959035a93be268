#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes a compressed man page of raystage, of every command and of every sub-command from their own --help,
# with help2man. Commands are found in the lists "Commands:" and "Subcommands:" of the help.
# Usage: make_man_pages.sh RAYSTAGE DESCRIPTION OUTPUT_FOLDER      (the folder is replaced)
set -euo pipefail
raystage="$1"
description="$2"
out="$3"
# Every build of a commit gives the same bytes: without this variable help2man writes the date.
if [ -z "${SOURCE_DATE_EPOCH:-}" ]; then
  SOURCE_DATE_EPOCH="$(git -C "$(dirname "$0")" log -1 --format=%ct 2>/dev/null || true)"
  [ -n "$SOURCE_DATE_EPOCH" ] && export SOURCE_DATE_EPOCH || unset SOURCE_DATE_EPOCH
fi
export LC_ALL=C.UTF-8
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
version="$("$raystage" --version | head -n 1)"
rm -rf "$out"
mkdir -p "$out"

# Prints "NAME<tab>SUMMARY" of each command in a help text.
listed() {
  awk '/^(Commands|Subcommands):/ { list = 1; next }
       list && /^  [a-z]/ { name = $1; sub(/^ +[^ ]+ */, ""); print name "\t" $0; next }
       list && /^ /       { next }
                          { list = 0 }' "$1"
}

# Prints the help as man pages show it: "-h, --help"; the usage line alone; no exit codes, which get
# a section. CLI11 begins descriptions in column 34. help2man needs two spaces before a description;
# where the help has only one, a second is inserted.
page_help() {
  perl -pe 'substr($_, 33, 0) = " " if length > 34 && /^  -/ && substr($_, 0, 33) !~ /\S  / &&
      substr($_, 32, 3) =~ /^\S \S/ && substr($_, 34) !~ /^(in \[|- |\.\.\.|REQUIRED|Needs:|Excludes:|\(Env:)/' "$1" |
    sed -E -e '/^Exit codes:/,/^$/d' -e 's/^(  -[A-Za-z0-9]),--/\1, --/' \
      -e '/^  [^ ]/s/ REQUIRED( |$)/ (required)\1/' -e '/^Usage:/s/ {2,}.*//' -e '/^Usage:/s/\[OPTIONS\]/[OPTION...]/'
}

# Prints "Exit codes: 0 done; 1 failed" from stdin as a section with a list.
exit_status() {
  perl -0777 -ne 's/\s+/ /g; s/^Exit codes: // or exit; s/\.? *$//; print "[EXIT STATUS]\n";
    print /^(\d+(?:\+n)?) (.*)/ ? ".TP\n$1\n$2\n" : "$_\n" for split /[,;] (?=\d+(?:\+n)? )/; print "\n"'
}

make_page() {  # SUMMARY WORD...: the command raystage WORD..., and those below it
  local summary="$1"
  shift
  local name help child child_summary related
  name="$(IFS=-; echo "raystage${*:+-}$*")"
  help="$work/$name.help"
  "$raystage" "$@" --help >"$help"
  related=()
  if [ $# -gt 0 ]; then
    related+=("$(IFS=-; parent=("raystage" "${@:1:$#-1}"); echo "${parent[*]}")")
  fi
  while IFS=$'\t' read -r child child_summary; do
    related+=("$name-$child")
    make_page "$child_summary" "$@" "$child"
  done < <(listed "$help")

  page_help "$help" >"$work/$name.text"
  # help2man calls a program with --help and --version; the script below answers for it.
  {
    echo '#!/bin/sh'
    echo "case \"\$1\" in --version) echo '$name ${version#* }' ;; *) cat '$work/$name.text' ;; esac"
  } >"$work/$name"
  chmod +x "$work/$name"
  {
    sed -n '/^Exit codes:/,/^$/p' "$help" | exit_status
    echo '[SEE ALSO]'
    local separator=''
    for child in "${related[@]}"; do
      printf '%s.BR %s (1)' "$separator" "$child"
      separator=$',\n'
    done
    printf '\n.PP\nGuides, formats and example shots: the folder share/doc/raystage of the installation.\n'
  } >"$work/$name.include"
  help2man --no-info --section=1 --manual='Raystage' --source="$version" --name="$summary" \
    --include="$work/$name.include" --output="$out/$name.1" "$work/$name"
  gzip -9n "$out/$name.1"
}

make_page "$description"
