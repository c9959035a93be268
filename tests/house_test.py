#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the sources to the house: arrows run down only, no source is without its licence line, and
no link in the documentation leads nowhere.

Reads every #include "folder/..." of our own, and in every Markdown file the links to files and
headings of ours.
"""
import pathlib
import posixpath
import re
import subprocess
import sys
import urllib.parse

# Top to bottom. A folder may include from itself and from what stands below it.
HOUSE = ["tests", "cli", "farm", "replay", "compose", "calibrate", "render", "ingest", "images", "store", "rig",
         "charts", "schemas"]
# Folders in folders: their own little house, bottom last.
ROOMS = {
    "rig/calibration": ["rig"],
    "store/fixity": ["store", "store/jpeg"],
    "store/frames": ["store", "store/jpeg"],
    "store/jpeg": [],
    "store/mattes": ["store", "store/frames", "store/jpeg"],
    "store/sync": ["store", "store/jpeg"],
    "store/retime": ["store", "store/jpeg"],
    "store": ["store/jpeg"],
    "render/view": [],
    "render/sampling": ["render/view"],
    "render/matching": [],
    "render/quality": ["render/view"],
    "render/fill": ["render/view"],
    "render/fragments": [],
    "render/planar": ["render/sampling", "render/view"],
    "render/automatic": ["render/depth", "render/matching", "render/planar", "render/quality",
                         "render/sweep", "render/view"],
    "render/sweep": ["render/matching", "render/sampling", "render/view"],
    "render/slabs": ["render/sampling", "render/view"],
    "render/lumigraph": ["render/depth", "render/sampling", "render/view"],
    "render/hull": ["render/lumigraph", "render/view"],
    "render/confidence": ["render/sampling", "render/sweep", "render/view"],
    "render/rays": ["render/lumigraph", "render/sampling", "render/view"],
    "render/depth": ["render/matching", "render/sampling", "render/sweep", "render/view"],
    "render": ["render/automatic", "render/confidence", "render/depth", "render/fill", "render/fragments",
               "render/hull", "render/lumigraph", "render/matching", "render/planar", "render/quality", "render/rays",
               "render/sampling", "render/slabs", "render/sweep", "render/view"],
    "render/evaluation": ["render", "render/quality", "render/view"],
    "farm/ranks": ["farm"],
    "images/exr": [],
    "ingest/simulated": [],
    "ingest/record": ["ingest/sources"],
    "ingest/sources": ["ingest/simulated"],
    "compose/camera": [],
    "compose/color": [],
    "compose/exr": [],
    "compose/layers": ["compose/camera", "compose/exr"],
    "compose/geometry": ["compose/camera", "compose/exr", "compose/layers"],
    "compose": ["compose/camera", "compose/color", "compose/exr", "compose/geometry", "compose/layers"],
    "compose/preview": ["compose", "compose/camera", "compose/color", "compose/exr", "compose/geometry", "compose/layers"],
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


def without_blocks(markdown: str) -> str:
    """Fenced blocks hold no links and no headings; the lines stay as many."""
    return re.sub(r"^ *(```+|~~~+).*?^ *\1[`~]* *$",
                  lambda block: "\n" * block.group(0).count("\n"), markdown,
                  flags=re.MULTILINE | re.DOTALL)


INLINE_LINK = r"\]\(\s*<?([^)\s>]+)>?(?:\s+[\"'][^)]*)?\)"
REFERENCE = r"^ {0,3}\[[^\]^][^\]]*\]:\s*<?([^\s>]+)"
ELSEWHERE = r"[A-Za-z][A-Za-z0-9+.-]*:|//"


def links_of(markdown: str) -> list[tuple[int, str]]:
    """(line, target) of links, images and reference definitions, but not of those to elsewhere."""
    prose = re.sub(r"(`+)(?!`)[^\n]*?(?<!`)\1(?!`)", "", without_blocks(markdown))  # no code spans
    return [(prose.count("\n", 0, match.start()) + 1, match.group(1))
            for pattern in (INLINE_LINK, REFERENCE)
            for match in re.finditer(pattern, prose, flags=re.MULTILINE)
            if not re.match(ELSEWHERE, match.group(1))]


def anchors_of(markdown: str) -> set[str]:
    """The names by which headings can be linked to, made as GitHub and its kin make them."""
    text = without_blocks(markdown)
    names = set(re.findall(r"<a (?:id|name)=\"([^\"]+)\"", text))
    times: dict[str, int] = {}
    for heading in re.findall(r"^ {0,3}#{1,6}\s+(.*?)\s*#*\s*$", text, flags=re.MULTILINE):
        shown = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-")
        earlier = times.get(name, 0)
        times[name] = earlier + 1
        names.add(f"{name}-{earlier}" if earlier else name)
    return names


def broken_links(root: pathlib.Path, name: str, known: set[str]) -> tuple[int, list[str]]:
    """How many links a page has, and what is wrong with them. `known`: our files and folders."""
    links = links_of((root / name).read_text(encoding="utf-8"))
    complaints = []
    for line, link in links:
        target, _, anchor = urllib.parse.unquote(link).partition("#")
        # By name only: a link that leaves the checkout and comes back depends on where it lies.
        beside = posixpath.join(posixpath.dirname(name), target)
        where = posixpath.normpath(beside) if target else name
        file = root / where
        if where not in known:
            complaints.append(f"{name}:{line}: link to '{link}', which is no file of the project")
        elif anchor and (file.suffix != ".md" or
                         anchor not in anchors_of(file.read_text(encoding="utf-8"))):
            complaints.append(f"{name}:{line}: link to '{link}', whose heading is not there")
    return len(links), complaints


def main() -> int:
    root = pathlib.Path(__file__).resolve().parent.parent
    listed = subprocess.run(["git", "-C", root, "ls-files", "-co", "--exclude-standard"],
                            capture_output=True, text=True, check=True).stdout.split("\n")
    known = {name for name in listed if name and (root / name).is_file()}
    known |= {str(folder) for name in known for folder in pathlib.PurePosixPath(name).parents}
    complaints = []
    arrows = links = 0
    for name in listed:
        path = pathlib.PurePosixPath(name)
        file = root / name
        if path.suffix == ".md" and file.is_file():
            count, broken = broken_links(root, name, known)
            links += count
            complaints += broken
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
    if links < 20:
        complaints.append(f"only {links} links found: this check no longer sees the documentation")
    print("\n".join(complaints) or
          f"{arrows} arrows, all running down; {links} links, all leading somewhere")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
