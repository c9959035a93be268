#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs clang-tidy on sources, except on those that passed before with the same content.

Usage: clang_tidy.py [--record-only] COMMANDS_FOLDER CACHE_FOLDER SOURCE...

COMMANDS_FOLDER holds compile_commands.json. A source's key is a hash of its text, of every header of the
project that it includes directly or through others, of its compiler flags, of .clang-tidy and of the
versions of clang-tidy and of the packages that the project stands on. CACHE_FOLDER holds an empty file
for each key that passed; keys that nobody used for 60 days are removed. With --record-only nothing is run
and all sources count as passed.

Exit code 1: clang-tidy has complaints, which it has printed.
"""
import concurrent.futures
import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys
import time

TOOL = "clang-tidy-14"
KEPT_SECONDS = 60 * 24 * 3600
ROOT = pathlib.Path(__file__).resolve().parent.parent


def output_of(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def package_versions() -> str:
    lines = (ROOT / "scripts/packages.txt").read_text(encoding="utf-8").splitlines()
    names = [line.split()[0] for line in lines if line and not line.startswith("#")]
    # Packages that are not installed are no part of the build.
    found = subprocess.run(["dpkg-query", "-W", "-f", "${Package} ${Version}\n", *names],
                           capture_output=True, text=True)
    return found.stdout


class Sources:
    """The texts of the project's files, and what they include."""

    def __init__(self) -> None:
        self._includes: dict[str, list[str]] = {}
        self._digests: dict[str, bytes] = {}

    def _read(self, file: str) -> None:
        path = ROOT / file
        if not path.is_file() and (ROOT / (file + ".in")).is_file():
            path = ROOT / (file + ".in")  # CMake writes the header from it
        text = path.read_bytes() if path.is_file() else b""
        self._digests[file] = hashlib.sha256(text).digest()
        self._includes[file] = re.findall(r'^#\s*include "([^"]+)"', text.decode(errors="replace"),
                                          flags=re.MULTILINE)

    def digest(self, source: str) -> bytes:
        """Of a source and of everything of the project that it includes."""
        reached, waiting = {source}, [source]
        while waiting:
            file = waiting.pop()
            if file not in self._includes:
                self._read(file)
            for included in self._includes[file]:
                if included not in reached:
                    reached.add(included)
                    waiting.append(included)
        total = hashlib.sha256()
        for file in sorted(reached):
            total.update(file.encode() + b"\0" + self._digests[file])
        return total.digest()


def flags_of(commands: pathlib.Path) -> dict[str, str]:
    """Compiler flags by source, without the places of checkout and build."""
    flags = {}
    for entry in json.loads((commands / "compile_commands.json").read_text(encoding="utf-8")):
        command = entry.get("command") or " ".join(entry["arguments"])
        for folder in (str(commands.resolve()), str(ROOT)):
            command = command.replace(folder, "")
        source = os.path.relpath(os.path.join(entry["directory"], entry["file"]), ROOT)
        flags[source] = command
    return flags


def remove_old(cache: pathlib.Path) -> None:
    for entry in cache.iterdir():
        if time.time() - entry.stat().st_mtime > KEPT_SECONDS:
            entry.unlink()


def main() -> int:
    arguments = sys.argv[1:]
    record_only = arguments[:1] == ["--record-only"]
    if record_only:
        arguments = arguments[1:]
    commands, cache, names = pathlib.Path(arguments[0]), pathlib.Path(arguments[1]), arguments[2:]
    cache.mkdir(parents=True, exist_ok=True)
    remove_old(cache)
    common = hashlib.sha256("\0".join(
        [output_of(TOOL, "--version"), (ROOT / ".clang-tidy").read_text(encoding="utf-8"),
         package_versions()]).encode()).digest()
    flags, sources = flags_of(commands), Sources()
    todo = []
    for name in names:
        if name not in flags:
            sys.exit(f"{name}: no target compiles it. Add it to the CMakeLists.txt of its folder.")
        key = hashlib.sha256(common + flags[name].encode() + sources.digest(name)).hexdigest()
        stamp = cache / key
        if stamp.exists() or record_only:
            stamp.touch()
        else:
            todo.append((name, stamp))
    print(f"clang-tidy: {len(names)} files, {len(todo)} of them not known to pass", flush=True)

    def check(pair: tuple[str, pathlib.Path]) -> bool:
        name, stamp = pair
        run = subprocess.run([TOOL, "--quiet", "--extra-arg=-Wno-unknown-warning-option", "-p",
                              str(commands), name], cwd=ROOT, capture_output=True, text=True)
        if run.returncode == 0:
            stamp.touch()
        else:
            print(run.stdout + run.stderr, flush=True)
        return run.returncode == 0

    with concurrent.futures.ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        failed = list(pool.map(check, todo)).count(False)
    print(f"clang-tidy: {failed} files with complaints" if failed else "clang-tidy has no complaint")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
