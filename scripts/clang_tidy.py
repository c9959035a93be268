#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs clang-tidy on translation units, except on those that passed before with the same content.

Usage: clang_tidy.py COMMANDS_FOLDER CACHE_FOLDER SOURCE...

COMMANDS_FOLDER holds compile_commands.json of a unity build: one clang-tidy run checks several sources and
reads their headers once. Only units that compile one of the SOURCEs are checked; every SOURCE must be in
one. The key of a unit is a hash of the texts of its sources and of all project headers that they include, of its
compiler flags, of .clang-tidy and of the versions of clang-tidy and of the packages in scripts/packages.txt.
CACHE_FOLDER holds an empty file for each key that passed; keys that were not used for 60 days are removed.

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
    # The build does not depend on packages that are not installed.
    found = subprocess.run(["dpkg-query", "-W", "-f", "${Package} ${Version}\n", *names],
                           capture_output=True, text=True)
    return found.stdout


def included_by(text: str) -> list[str]:
    """Project files that a source includes, relative to the project."""
    names = re.findall(r'^#\s*include "([^"]+)"', text, flags=re.MULTILINE)
    return [os.path.relpath(name, ROOT) if os.path.isabs(name) else name for name in names]


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
        self._includes[file] = included_by(text.decode(errors="replace"))

    def digest(self, sources: list[str]) -> bytes:
        """Of sources and of everything of the project that they include."""
        reached, waiting = set(sources), list(sources)
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


class Unit:
    """A translation unit: its file, the project's sources in it, and its compiler flags."""

    def __init__(self, entry: dict[str, str], commands: pathlib.Path) -> None:
        self.file = os.path.join(entry["directory"], entry["file"])
        command = entry.get("command") or " ".join(entry["arguments"])
        for folder in (str(commands.resolve()), str(ROOT)):
            command = command.replace(folder, "")
        self.flags = command
        is_unity = os.path.basename(self.file).startswith("unity_")
        text = pathlib.Path(self.file).read_text(encoding="utf-8") if is_unity else ""
        self.sources = included_by(text) if is_unity else [os.path.relpath(self.file, ROOT)]


def units_of(commands: pathlib.Path) -> list[Unit]:
    entries = json.loads((commands / "compile_commands.json").read_text(encoding="utf-8"))
    return [Unit(entry, commands) for entry in entries]


def remove_old(cache: pathlib.Path) -> None:
    for entry in cache.iterdir():
        if time.time() - entry.stat().st_mtime > KEPT_SECONDS:
            entry.unlink()


def main() -> int:
    commands, cache, names = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3:]
    cache.mkdir(parents=True, exist_ok=True)
    remove_old(cache)
    common = hashlib.sha256("\0".join(
        [output_of(TOOL, "--version"), (ROOT / ".clang-tidy").read_text(encoding="utf-8"),
         package_versions()]).encode()).digest()
    units, sources = units_of(commands), Sources()
    compiled = {source for unit in units for source in unit.sources}
    for name in names:
        if name not in compiled:
            sys.exit(f"{name}: no target compiles it. Add it to the CMakeLists.txt of its folder.")
    wanted = set(names)
    todo: list[tuple[Unit, pathlib.Path]] = []
    for unit in units:
        if wanted.isdisjoint(unit.sources):
            continue
        stamp = cache / hashlib.sha256(common + unit.flags.encode() + sources.digest(unit.sources)).hexdigest()
        if stamp.exists():
            stamp.touch()
        else:
            todo.append((unit, stamp))
    print(f"clang-tidy: {len(names)} files; {len(todo)} units are not known to pass", flush=True)

    def check(pair: tuple[Unit, pathlib.Path]) -> bool:
        unit, stamp = pair
        run = subprocess.run([TOOL, "--quiet", "--extra-arg=-Wno-unknown-warning-option", "-p",
                              str(commands), unit.file], cwd=ROOT, capture_output=True, text=True)
        if run.returncode == 0:
            stamp.touch()
        else:
            print(run.stdout + run.stderr, flush=True)
        return run.returncode == 0

    with concurrent.futures.ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        failed = list(pool.map(check, todo)).count(False)
    print(f"clang-tidy: {failed} units with complaints" if failed else "clang-tidy has no complaint")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
