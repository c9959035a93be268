#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the sources against the structure that CMake builds, and the links in the documentation.

Usage: module_graph_test.py MODULE_GRAPH_JSON [--write-readme]

MODULE_GRAPH_JSON is module_graph.json in the build folder: CMake writes the libraries and commands of each folder and what they
link. Checked are:
  * every #include "folder/..." of a library's folder: the library links the included folder, publicly where a header
    includes it. Tests and tests/ may include from every folder, testing/ from those of the product;
  * the graph of libraries and that of top-level folders have no cycle;
  * the diagram in README.md is the one that this script draws from MODULE_GRAPH_JSON (--write-readme replaces it);
  * each source starts with its licence line;
  * each link in a Markdown file leads to a file and heading of the project.
"""
import collections
import json
import pathlib
import posixpath
import re
import subprocess
import sys
import urllib.parse

TEST_FOLDERS = {"testing", "tests"}
DIAGRAM = re.compile(r"(<!-- module graph: .*?-->\n```mermaid\n)(.*?)(```\n)", re.DOTALL)


class ModuleGraph:
    """Libraries and commands by folder, and which folders each may include from."""

    def __init__(self, targets: list[dict[str, str]]) -> None:
        self.folder_of = {target["target"]: target["folder"] for target in targets}
        self.links: dict[str, set[str]] = collections.defaultdict(set)    # of folders
        self.exposed: dict[str, set[str]] = collections.defaultdict(set)  # the public ones
        self.libraries: dict[str, set[str]] = {}
        for target in targets:
            public, private = target["public"].split(), target["private"].split()
            self.libraries[target["target"]] = {name for name in public + private if name in self.folder_of}
            linked = {self.folder_of.get(name, "") for name in public + private}
            self.links[target["folder"]] |= linked
            # Headers of a command are not included elsewhere.
            is_command = not target["target"].startswith("raystage_")
            self.exposed[target["folder"]] |= (
                linked if is_command else {self.folder_of.get(name, "") for name in public})

    def top_folders(self) -> dict[str, set[str]]:
        """Returns top-level folders and those that they link, without test support."""
        graph: dict[str, set[str]] = {folder.split("/")[0]: set() for folder in self.links}
        for folder, linked in self.links.items():
            top = folder.split("/")[0]
            graph[top] |= {other.split("/")[0] for other in linked if other} - {top}
        return {top: linked for top, linked in graph.items() if top not in TEST_FOLDERS}


def cycle_in(graph: dict[str, set[str]]) -> list[str]:
    """Returns the names along one cycle, or nothing."""
    finished: set[str] = set()

    def visit(name: str, path: list[str]) -> list[str]:
        if name in path:
            return path[path.index(name):] + [name]
        if name in finished:
            return []
        for following in sorted(graph.get(name, ())):
            found = visit(following, path + [name])
            if found:
                return found
        finished.add(name)
        return []

    return next((found for name in sorted(graph) if (found := visit(name, []))), [])


def reachable(graph: dict[str, set[str]], start: str) -> set[str]:
    found: set[str] = set()
    waiting = [start]
    while waiting:
        for following in graph[waiting.pop()]:
            if following not in found:
                found.add(following)
                waiting.append(following)
    return found


def diagram_of(graph: dict[str, set[str]]) -> str:
    """Returns a Mermaid flow chart of the transitive reduction."""
    lines = ["flowchart TD"]
    for top in sorted(graph):
        for linked in sorted(graph[top]):
            if not any(linked in reachable(graph, other) for other in graph[top] - {linked}):
                lines.append(f"  {top} --> {linked}")
    return "\n".join(lines) + "\n"


def without_blocks(markdown: str) -> str:
    """Returns the text without fenced blocks, which contain no links or headings; keeps line numbers."""
    return re.sub(r"^ *(```+|~~~+).*?^ *\1[`~]* *$",
                  lambda block: "\n" * block.group(0).count("\n"), markdown,
                  flags=re.MULTILINE | re.DOTALL)


INLINE_LINK = r"\]\(\s*<?([^)\s>]+)>?(?:\s+[\"'][^)]*)?\)"
REFERENCE = r"^ {0,3}\[[^\]^][^\]]*\]:\s*<?([^\s>]+)"
ELSEWHERE = r"[A-Za-z][A-Za-z0-9+.-]*:|//"


def links_of(markdown: str) -> list[tuple[int, str]]:
    """Returns (line, target) of links, images and reference definitions within the project."""
    prose = re.sub(r"(`+)(?!`)[^\n]*?(?<!`)\1(?!`)", "", without_blocks(markdown))  # no code spans
    return [(prose.count("\n", 0, match.start()) + 1, match.group(1))
            for pattern in (INLINE_LINK, REFERENCE)
            for match in re.finditer(pattern, prose, flags=re.MULTILINE)
            if not re.match(ELSEWHERE, match.group(1))]


def anchors_of(markdown: str) -> set[str]:
    """Returns the anchors of headings, as GitHub generates them."""
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
    """Returns the number of a page's links, and the broken ones. `known`: files and folders of the project."""
    links = links_of((root / name).read_text(encoding="utf-8"))
    complaints = []
    for line, link in links:
        target, _, anchor = urllib.parse.unquote(link).partition("#")
        # By name only: a link out of the checkout and back depends on the checkout's folder.
        joined = posixpath.join(posixpath.dirname(name), target)
        where = posixpath.normpath(joined) if target else name
        file = root / where
        if where not in known:
            complaints.append(f"{name}:{line}: link to '{link}', which is not a file of the project")
        elif anchor and (file.suffix != ".md" or
                         anchor not in anchors_of(file.read_text(encoding="utf-8"))):
            complaints.append(f"{name}:{line}: link to '{link}', whose heading does not exist")
    return len(links), complaints


def include_complaints(graph: ModuleGraph, name: str, text: str) -> tuple[int, list[str]]:
    """Returns the number of project includes in a source, and those that its library does not link."""
    folder = posixpath.dirname(name)
    is_header = name.endswith(".h")
    may_use_tests = name.endswith("_test.cpp") or folder.split("/")[0] in TEST_FOLDERS
    count, complaints = 0, []
    for number, line in enumerate(text.split("\n"), 1):
        match = re.match(r'#include "([a-z_]+(?:/[a-z_]+)*)/[^"/]+"', line)
        if not match:
            continue
        count += 1
        used = match.group(1)
        if used == folder or may_use_tests:
            continue
        if used not in graph.links.get(folder, ()):
            complaints.append(f"{name}:{number}: no library of {folder}/ links one of {used}/ (CMakeLists.txt)")
        elif is_header and used not in graph.exposed[folder]:
            complaints.append(f"{name}:{number}: a header includes {used}/: link it as PUBLIC in {folder}/CMakeLists.txt")
    return count, complaints


def main() -> int:
    root = pathlib.Path(__file__).resolve().parent.parent
    modules = ModuleGraph(json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8")))
    readme = root / "README.md"
    diagram = diagram_of(modules.top_folders())
    if "--write-readme" in sys.argv[2:]:
        text = readme.read_text(encoding="utf-8")
        readme.write_text(DIAGRAM.sub(lambda found: found[1] + diagram + found[3], text), encoding="utf-8")
    complaints = []
    for graph, kind in ((modules.libraries, "libraries"), (modules.top_folders(), "folders")):
        cycle = cycle_in(graph)
        if cycle:
            complaints.append(f"cycle of {kind}: {' -> '.join(cycle)}")
    drawn = DIAGRAM.search(readme.read_text(encoding="utf-8"))
    if not drawn or drawn[2] != diagram:
        complaints.append("README.md: the diagram of the folders differs from the CMake targets. Run "
                          "tests/module_graph_test.py BUILD/module_graph.json --write-readme")
    listed = subprocess.run(["git", "-C", root, "ls-files", "-co", "--exclude-standard"],
                            capture_output=True, text=True, check=True).stdout.split("\n")
    known = {name for name in listed if name and (root / name).is_file()}
    known |= {str(folder) for name in known for folder in pathlib.PurePosixPath(name).parents}
    includes = links = 0
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
        if path.suffix in {".cpp", ".h"}:
            count, unlinked = include_complaints(modules, name, text)
            includes += count
            complaints += unlinked
    if includes < 20:
        complaints.append(f"only {includes} includes found: the check does not find the sources")
    if links < 20:
        complaints.append(f"only {links} links found: the check does not find the documentation")
    print("\n".join(complaints) or
          f"{includes} includes, all linked; {links} links in documents, all valid; no cycle")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
