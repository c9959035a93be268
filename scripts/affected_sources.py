#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints the sources that clang-tidy has to look at: those that changed, or include what changed, since
the commit named in scripts/clang_tidy_baseline.txt, at which it had no complaint about any.

Usage: affected_sources.py SOURCE...    All of them where the baseline is not in the history, or the
checks themselves have changed.
"""
import pathlib
import re
import subprocess
import sys


def git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], check=True, capture_output=True, text=True).stdout


def changed_since(baseline: str) -> set[str] | None:
    known = subprocess.run(["git", "cat-file", "-e", baseline + "^{commit}"], capture_output=True)
    if known.returncode != 0:
        return None
    changed = set(git("diff", "--name-only", baseline).split())
    return None if ".clang-tidy" in changed else changed


def with_includers(changed: set[str]) -> set[str]:
    """`changed` and every file that includes one of them, directly or through others."""
    includers: dict[str, set[str]] = {}
    for file in git("ls-files", "*.h", "*.cpp").split():
        text = pathlib.Path(file).read_text(encoding="utf-8")
        for included in re.findall(r'^#include "([^"]+)"', text, flags=re.MULTILINE):
            includers.setdefault(included, set()).add(file)
    affected, waiting = set(changed), list(changed)
    while waiting:
        for file in includers.get(waiting.pop(), set()) - affected:
            affected.add(file)
            waiting.append(file)
    return affected


def main() -> None:
    sources = sys.argv[1:]
    baseline = pathlib.Path(__file__).with_name("clang_tidy_baseline.txt").read_text().strip()
    changed = changed_since(baseline)
    affected = set(sources) if changed is None else with_includers(changed)
    for source in sources:
        if source in affected:
            print(source)


if __name__ == "__main__":
    main()
