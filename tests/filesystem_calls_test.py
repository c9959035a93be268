#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that no file or folder is examined by a function of std::filesystem that throws.

Usage: filesystem_calls_test.py ROOT

A link to itself, a name that is too long or a folder that may not be searched makes std::filesystem::exists(path) throw, and what a
stranger's take holds must not end a command. Below a take, base/contained_path.h examines files; elsewhere file_exists() or the overloads
with std::error_code do. Checked are the sources of ROOT but tests: calls of functions that only examine, without an error_code, unless their
argument is a file_status, and range-based for loops over folders, whose increment throws.
"""
import pathlib
import re
import sys

EXAMINE = re.compile(r"(?:fs|filesystem)::(exists|is_directory|is_regular_file|is_symlink|is_empty|file_size|status|symlink_status|"
                     r"equivalent|last_write_time|read_symlink|directory_iterator|recursive_directory_iterator)\s*(?:\w+\s*)?\(")
METHODS = re.compile(r"(?:->|\.)(is_directory|is_regular_file|is_symlink|file_size|status|symlink_status)\(\)")
LOOP = re.compile(r"for \((?:const )?auto&{0,2} \w+ :\s*(?:std::)?(?:fs|filesystem)::(?:recursive_)?directory_iterator")
ERRORS = re.compile(r"^(\w*error\w*|ignored|none|unknown|gone_already|of_entry)$")
STATUS = re.compile(r"^(status|there|(?:std::)?(?:fs|filesystem)::(?:symlink_)?status\(.*|\w+(?:->|\.)(?:symlink_)?status\(.*)$", re.DOTALL)


def arguments(text: str, begin: int) -> list[str]:
    """Returns the arguments of a call whose "(" is before `begin`."""
    found, depth, start = [], 0, begin
    for at in range(begin, len(text)):
        if text[at] in "([{":
            depth += 1
        elif text[at] in ")]}":
            if depth == 0:
                return [part.strip() for part in found + [text[start:at]] if part.strip()]
            depth -= 1
        elif text[at] == "," and depth == 0:
            found.append(text[start:at])
            start = at + 1
    return found


def throwing_calls(text: str) -> list[int]:
    """Returns the offsets of the calls that throw."""
    found = [match.start() for match in LOOP.finditer(text)]
    for match in EXAMINE.finditer(text):
        given = arguments(text, match.end())
        if not given or ERRORS.match(given[-1]):  # the end of an iteration, or a call that does not throw
            continue
        if not (match.group(1) in ("exists", "is_directory", "is_regular_file", "is_symlink") and STATUS.match(given[0])):
            found.append(match.start())
    # Of a file_status that is at hand, it is `fs::is_directory(entry->symlink_status(error))`.
    return found + [match.start() for match in METHODS.finditer(text) if re.search(r"entry\w*$", text[:match.start()])]


def self_test() -> None:
    for text, count in (("if (fs::exists(path)) {", 1), ("std::filesystem::exists(folder / \"a\")", 1), ("fs::exists(path, error)", 0),
                        ("fs::exists(fs::symlink_status(path, error))", 0), ("fs::exists(fs::symlink_status(path))", 1),
                        ("fs::directory_iterator entry(folder, error), end", 0), ("fs::directory_iterator entry(folder)", 1),
                        ("for (const auto& entry : fs::directory_iterator(folder, error)) {", 1), ("entry->is_regular_file()", 1),
                        ("entry->is_regular_file(error)", 0), ("fs::is_directory(status)", 0)):
        assert len(throwing_calls(text)) == count, text


def main() -> int:
    self_test()
    root = pathlib.Path(sys.argv[1])
    complaints = []
    for file in sorted(root.rglob("*")):
        name = file.relative_to(root)
        if file.suffix not in (".cpp", ".h") or name.parts[0] in ("tests", "testing", "build") or file.stem.endswith("_test"):
            continue
        if "misbehaving" in file.stem:  # a test's decoder
            continue
        text = file.read_text(encoding="utf-8")
        complaints += [f"{name}:{text.count(chr(10), 0, at) + 1}: throws where the file cannot be examined: "
                       f"{text[at:text.find(chr(10), at)].strip()}" for at in throwing_calls(text)]
    print("\n".join(complaints))
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
