#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the sources to the house: arrows run down only, and no source is without its licence line.

Reads every #include "folder/..." of our own and the links in each folder's CMakeLists.txt.
"""
import pathlib
import re
import subprocess
import sys

# Top to bottom. A folder may include from itself and from what stands below it.
HOUSE = ["tests", "cli", "farm", "replay", "compose", "render", "ingest", "images", "store", "rig",
         "schemas"]
# Folders in folders: their own little house, bottom last.
ROOMS = {
    "store/frames": ["store", "store/jpeg"],
    "store/jpeg": [],
    "store/sync": ["store", "store/jpeg"],
    "store": ["store/jpeg"],
    "render/evaluation": ["render"],
    "ingest/simulated": [],
    "compose/preview": ["compose"],
}


def room_of(path: pathlib.PurePosixPath) -> str:
    parts = path.parts
    two = "/".join(parts[:2])
    return two if two in ROOMS else parts[0]


def may_see(user: str, used: str) -> bool:
    if user == used:
        return True
    user_floor, used_floor = user.split("/")[0], used.split("/")[0]
    if user_floor == used_floor:
        return used in ROOMS.get(user, [])
    return HOUSE.index(user_floor) < HOUSE.index(used_floor)


def main() -> int:
    root = pathlib.Path(__file__).resolve().parent.parent
    listed = subprocess.run(["git", "-C", root, "ls-files", "-co", "--exclude-standard"],
                            capture_output=True, text=True, check=True).stdout.split("\n")
    complaints = []
    arrows = 0
    for name in listed:
        path = pathlib.PurePosixPath(name)
        file = root / name
        if path.suffix not in {".cpp", ".h", ".sh", ".py"} or not file.is_file():
            continue
        text = file.read_text(encoding="utf-8")
        if "SPDX-License-Identifier: Apache-2.0" not in "\n".join(text.split("\n")[:3]):
            complaints.append(f"{name}: no SPDX line at the top")
        if path.suffix not in {".cpp", ".h"}:
            continue
        is_test = path.stem.endswith("_test")
        for number, line in enumerate(text.split("\n"), 1):
            match = re.match(r'#include "([a-z_]+/[^"]+)"', line)
            if not match:
                continue
            used = room_of(pathlib.PurePosixPath(match.group(1)))
            if used.split("/")[0] not in HOUSE:
                complaints.append(f"{name}:{number}: '{used}' is no folder of the house")
                continue
            arrows += 1
            user = room_of(path)
            if not may_see(user, used) and not (is_test and user.split("/")[0] != "schemas"):
                complaints.append(f"{name}:{number}: {user}/ may not look up to {used}/")
    if arrows < 20:
        complaints.append(f"only {arrows} includes found: this check no longer sees the house")
    print("\n".join(complaints) or f"{arrows} arrows, all running down")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
