#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Bags, OCFL objects, PREMIS documents and event logs, read by code that follows the standards and shares none with ours."""
import collections
import csv
import hashlib
import json
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import xml.etree.ElementTree as ElementTree

BIN = pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"])
PREMIS = "{http://www.loc.gov/premis/v3}"
TYPE = "{http://www.w3.org/2001/XMLSchema-instance}type"

# Children in their order, of the elements of the PREMIS 3 schema (premis-v3-0.xsd) that are used; where it has a choice, the branch that is. "?": optional, "*": any number, "+": one or more.
PREMIS_SEQUENCES = {
    "premis": "object+ event* agent* rights*",
    "representation": "objectIdentifier+ preservationLevel* significantProperties* originalName? storage* relationship*",
    "file": "objectIdentifier+ preservationLevel* significantProperties* objectCharacteristics+ originalName? storage* "
            "signatureInformation* relationship*",
    "objectIdentifier": "objectIdentifierType objectIdentifierValue",
    "objectCharacteristics": "compositionLevel? fixity* size? format+ creatingApplication* inhibitors*",
    "fixity": "messageDigestAlgorithm messageDigest messageDigestOriginator?",
    "format": "formatDesignation formatRegistry? formatNote*",
    "formatDesignation": "formatName formatVersion?",
    "formatRegistry": "formatRegistryName formatRegistryKey formatRegistryRole?",
    "relationship": "relationshipType relationshipSubType relatedObjectIdentifier+",
    "relatedObjectIdentifier": "relatedObjectIdentifierType relatedObjectIdentifierValue relatedObjectSequence?",
    "event": "eventIdentifier eventType eventDateTime eventDetailInformation* eventOutcomeInformation* linkingAgentIdentifier* "
             "linkingObjectIdentifier*",
    "eventIdentifier": "eventIdentifierType eventIdentifierValue",
    "eventDetailInformation": "eventDetail?",
    "eventOutcomeInformation": "eventOutcome eventOutcomeDetail*",
    "eventOutcomeDetail": "eventOutcomeDetailNote",
    "linkingAgentIdentifier": "linkingAgentIdentifierType linkingAgentIdentifierValue linkingAgentRole*",
    "linkingObjectIdentifier": "linkingObjectIdentifierType linkingObjectIdentifierValue linkingObjectRole*",
    "agent": "agentIdentifier+ agentName* agentType? agentVersion? agentNote*",
    "agentIdentifier": "agentIdentifierType agentIdentifierValue",
}


def run(*arguments: object, code: int = 0) -> str:
    done = subprocess.run([str(BIN / "raystage"), *map(str, arguments)], stdin=subprocess.DEVNULL, capture_output=True,
                          check=False)
    if done.returncode != code:
        raise AssertionError(f"{arguments}: exit code {done.returncode}\n{done.stdout.decode()}{done.stderr.decode()}")
    return done.stdout.decode()


def digest(file: pathlib.Path, algorithm: str) -> str:
    return hashlib.new(algorithm, file.read_bytes()).hexdigest()


def files_of(folder: pathlib.Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def events_of(take: pathlib.Path) -> list[dict]:
    return [json.loads(line) for line in (take / "events.jsonl").read_text().splitlines()]


def manifest_of(file: pathlib.Path) -> dict[str, str]:
    entries = {}
    for line in file.read_text().splitlines():
        checksum, name = line.split("  ", 1)
        name = name.replace("%0D", "\r").replace("%0A", "\n").replace("%25", "%")
        assert name not in entries
        entries[name] = checksum
    return entries


def check_bag(bag: pathlib.Path) -> None:
    """A validator of bags of version 1.0 with SHA-256, after RFC 8493."""
    assert (bag / "bagit.txt").read_bytes() == b"BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n"
    names = set(files_of(bag))
    payload = manifest_of(bag / "manifest-sha256.txt")
    tags = manifest_of(bag / "tagmanifest-sha256.txt")
    assert set(payload) == {name for name in names if name.startswith("data/")}
    assert set(tags) == names - set(payload) - {"tagmanifest-sha256.txt"}
    for name, checksum in (payload | tags).items():
        assert digest(bag / name, "sha256") == checksum, name
    info = dict(line.split(": ", 1) for line in (bag / "bag-info.txt").read_text().splitlines())
    size = sum((bag / name).stat().st_size for name in payload)
    assert info["Payload-Oxum"] == f"{size}.{len(payload)}"
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", info["Bagging-Date"])


def check_order(element: ElementTree.Element) -> None:
    """Compares the children of an element of PREMIS with its sequence."""
    name = element.tag.removeprefix(PREMIS)
    if name == "object":
        name = element.attrib[TYPE].removeprefix("premis:")
    if len(element) == 0:
        assert name not in PREMIS_SEQUENCES and element.text, name
        return
    pattern = "".join(f"(?:{part.rstrip('?*+')} )" + (part[-1] if part[-1] in "?*+" else "")
                      for part in PREMIS_SEQUENCES[name].split())
    children = "".join(child.tag.removeprefix(PREMIS) + " " for child in element)
    assert re.fullmatch(pattern, children), (name, children)
    for child in element:
        check_order(child)


def check_object(root: pathlib.Path) -> dict:
    """A validator of OCFL 1.1 objects of one version; returns the inventory."""
    assert {entry.name for entry in root.iterdir()} == {"0=ocfl_object_1.1", "inventory.json", "inventory.json.sha512", "v1"}
    assert {entry.name for entry in (root / "v1").iterdir()} == {"inventory.json", "inventory.json.sha512", "content"}
    assert (root / "0=ocfl_object_1.1").read_bytes() == b"ocfl_object_1.1\n"
    for folder in (root, root / "v1"):
        sidecar = re.fullmatch(r"([0-9a-f]{128})[ \t]+inventory\.json\n", (folder / "inventory.json.sha512").read_text())
        assert sidecar and sidecar.group(1) == digest(folder / "inventory.json", "sha512")
    assert (root / "inventory.json").read_bytes() == (root / "v1/inventory.json").read_bytes()
    inventory = json.loads((root / "inventory.json").read_text())
    assert set(inventory) <= {"id", "type", "digestAlgorithm", "head", "contentDirectory", "manifest", "versions", "fixity"}
    assert inventory["type"] == "https://ocfl.io/1.1/spec/#inventory"
    assert inventory["digestAlgorithm"] == "sha512" and inventory["head"] == "v1"
    assert inventory["contentDirectory"] == "content" and re.match(r"[a-z][a-z0-9+.-]*:", inventory["id"])
    listed = {}
    for checksum, paths in inventory["manifest"].items():
        for path in paths:
            assert path not in listed and path.startswith("v1/content/") and ".." not in path.split("/")
            listed[path] = checksum
    stored = {"v1/content/" + name for name in files_of(root / "v1/content")}
    assert set(listed) == stored
    for path, checksum in listed.items():
        assert digest(root / path, "sha512") == checksum, path
    assert set(inventory["versions"]) == {"v1"}
    version = inventory["versions"]["v1"]
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z", version["created"])
    assert version["message"] and version["user"]["name"] and ":" in version["user"]["address"]
    assert set(version["state"]) == set(inventory["manifest"])
    logical = [path for paths in version["state"].values() for path in paths]
    assert len(logical) == len(set(logical)) and {"v1/content/" + path for path in logical} == stored
    for checksum, paths in inventory["fixity"]["sha256"].items():
        for path in paths:
            assert digest(root / path, "sha256") == checksum
    return inventory


class Bags(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="raystage-bag-")
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        self.take = self.root / "take"
        run("simulate", "-o", self.take, "--rows", 2, "--columns", 2, "--seconds", 1, "--width", 96, "--height", 64,
            "--truth-views", 0, "--edge-samples", 1, "-q")
        run("sync", self.take, "-q")

    def test_bags_are_valid_and_hold_the_take(self) -> None:
        (self.take / "50% of two\u00e9.txt").write_text("a note\n")
        run("verify", self.take, "--manifest", "write", "-q")
        before = files_of(self.take)
        bag = self.root / "bag"
        run("bag", self.take, "-o", bag, "--info", "Source-Organization: The Archive", "--info", "Contact-Name: A", "-q")
        check_bag(bag)
        self.assertEqual(files_of(bag / "data"), before)
        self.assertIn("Source-Organization: The Archive\nContact-Name: A\n", (bag / "bag-info.txt").read_text())
        for level in ("quick", "completeness", "checksums"):
            report = json.loads(run("bag", "--check", level, bag, "--json"))
            self.assertTrue(report["valid"])
            self.assertEqual(report["warnings"], [])
        # The payload is a take, whose checks leave the bag valid.
        run("verify", bag / "data", "--manifest", "check", "-q")
        check_bag(bag)
        # But for two events, the take is as it was.
        after = files_of(self.take)
        self.assertEqual(after.pop("events.jsonl").count(b"\n"), before.pop("events.jsonl").count(b"\n") + 2)
        self.assertEqual(after, before)

    def test_digests_of_frames_are_those_of_their_bytes(self) -> None:
        bag = self.root / "bag"
        run("bag", self.take, "-o", bag, "-q")
        with open(bag / "xxh3/frames.csv", newline="", encoding="utf-8") as file:
            frames = list(csv.DictReader(file))
        self.assertEqual(len(frames), int(re.search(r"(\d+) frames", run("info", self.take)).group(1)))
        for frame in frames[::7]:
            with open(bag / frame["archive"], "rb") as archive:
                archive.seek(int(frame["offset"]))
                data = archive.read(int(frame["bytes"]))
            self.assertEqual((data[:2], data[-2:]), (b"\xff\xd8", b"\xff\xd9"))
        files = [line.split("  ", 1) for line in (bag / "xxh3/files.txt").read_text().splitlines()]
        self.assertEqual({name for _, name in files}, set(manifest_of(bag / "manifest-sha256.txt")))
        program = shutil.which("xxhsum")
        if program:
            for checksum, name in files[:5]:
                said = subprocess.run([program, "-H3", bag / name], capture_output=True, check=True).stdout.decode()
                self.assertTrue(said.startswith(checksum) or checksum.removeprefix("XXH3_") in said, said)

    def test_premis_has_the_events_and_files(self) -> None:
        run("verify", self.take, "-q")
        bag = self.root / "bag"
        run("bag", self.take, "-o", bag, "--identifier", "ark:/12345/a&b<c>", "-q")
        root = ElementTree.parse(bag / "premis.xml").getroot()
        self.assertEqual((root.tag, root.attrib["version"]), (PREMIS + "premis", "3.0"))
        check_order(root)
        types = [event.findtext(PREMIS + "eventType") for event in root.iter(PREMIS + "event")]
        self.assertEqual(types, ["creation", "metadata modification", "fixity check", "fixity check",
                                 "information package creation"])
        objects = list(root.iter(PREMIS + "object"))
        self.assertEqual(objects[0].findtext(f"{PREMIS}objectIdentifier/{PREMIS}objectIdentifierValue"), "ark:/12345/a&b<c>")
        payload = manifest_of(bag / "manifest-sha256.txt")
        for item in objects[1:]:
            name = item.findtext(f"{PREMIS}objectIdentifier/{PREMIS}objectIdentifierValue")
            self.assertEqual(item.findtext(f".//{PREMIS}messageDigest"), payload.pop(name))
            self.assertEqual(int(item.findtext(f".//{PREMIS}size")), (bag / name).stat().st_size)
        self.assertEqual(payload, {})
        agents = {value.text for value in root.iter(PREMIS + "agentIdentifierValue")}
        self.assertEqual(agents, {value.text for value in root.iter(PREMIS + "linkingAgentIdentifierValue")})

    def test_the_bag_explains_itself(self) -> None:
        bag = self.root / "bag"
        run("bag", self.take, "-o", bag, "-q")
        with open(bag / "representation/formats.csv", newline="", encoding="utf-8") as file:
            formats = list(csv.DictReader(file))
        for row in formats:
            self.assertTrue(re.fullmatch(r"(x-)?fmt/\d+|none registered", row["PRONOM"]), row)
            if row["page"]:
                self.assertTrue((bag / "representation" / row["page"]).is_file(), row)
        self.assertIn("fmt/43", {row["PRONOM"] for row in formats})
        for schema in (bag / "representation/schemas").iterdir():
            self.assertIn("$id", json.loads(schema.read_text()))
        # The reader in the bag reads the take in the bag.
        subprocess.run([sys.executable, bag / "representation/reader/read_take.py", bag / "data", "-o", self.root / "read"],
                       stdin=subprocess.DEVNULL, check=True)
        self.assertEqual(len(json.loads((self.root / "read/take.json").read_text())["cameras"]), 4)

    def test_ocfl_objects_are_valid_and_hold_a_valid_bag(self) -> None:
        shutil.copy(self.take / "rig.json", self.take / "rig-copy.json")  # two files of one content
        before = files_of(self.take)
        run("bag", self.take, "-o", self.root / "object", "--ocfl", "--identifier", "urn:example:take", "-q")
        inventory = check_object(self.root / "object")
        self.assertEqual(inventory["id"], "urn:example:take")
        content = self.root / "object/v1/content"
        check_bag(content)
        run("bag", "--check", "checksums", content, "-q")
        self.assertEqual(files_of(content / "data"), before)

    def test_commands_append_events(self) -> None:
        packed, again = self.root / "packed", self.root / "again"
        run("verify", self.take, "-q")
        run("pack", self.take, "-o", packed, "-q", "--effort", 1)
        run("unpack", packed, "-o", again, "-q")
        run("verify", again, "--manifest", "write", "-q")
        run("sync", again, "-o", self.root / "retimed", "-q")
        archive = next((again / "archive").glob("*.mkv"))
        data = bytearray(archive.read_bytes())
        data[len(data) // 2] ^= 1
        archive.write_bytes(data)
        run("verify", again, "-q", code=1)
        run("repair", again, "-q", "--dry-run", code=3)
        run("repair", again, "-q", code=3)
        events = events_of(again)
        self.assertEqual([(event["type"], event["outcome"]) for event in events], [
            ("creation", "success"), ("metadata modification", "success"), ("fixity check", "success"),
            ("compression", "success"), ("decompression", "success"), ("fixity check", "success"),
            ("message digest calculation", "success"), ("fixity check", "failure"), ("modification", "warning")])
        self.assertEqual(len({event["id"] for event in events}), len(events))
        self.assertEqual([event["time_utc"] for event in events], sorted(event["time_utc"] for event in events))
        self.assertEqual([event["type"] for event in events_of(self.root / "retimed")], ["modification"])
        # The digest is that of coreutils, and changes with the take only.
        names = sorted(["rig.json", "take.json", *(f"archive/{file.name}" for file in (again / "archive").glob("*.journal"))])
        lines = "".join(f"{digest(again / name, 'sha256')}  {name}\n" for name in names)
        self.assertEqual(events[-1]["sha256"], hashlib.sha256(lines.encode()).hexdigest())
        self.assertEqual(events[5]["sha256"], events[4]["sha256"])
        self.assertNotEqual(events[-1]["sha256"], events[4]["sha256"])
        self.assertIn(b"events.jsonl", b" ".join(name.encode() for name in files_of(packed)))

    def test_checks_of_catalogues_and_bags_are_events_of_the_take(self) -> None:
        catalogue = self.root / "catalogue.json"
        check = ("verify", "--catalogue", self.root, "--catalogue-file", catalogue, "-q")
        run(*check)
        run("verify", self.take, "-q")
        self.assertIn("0 due; 0 checked now", run(*check), "an event is no change that makes a check due")
        run("plan", "epi", self.take, "--write", "--progress", "none")
        self.assertIn("1 checked now", run(*check))
        archive = next((self.take / "archive").glob("*.mkv"))
        data = bytearray(archive.read_bytes())
        data[len(data) // 2] ^= 1
        archive.write_bytes(data)
        run(*check, code=1)
        run("bag", self.take, "-o", self.root / "bag", "-q", code=2)
        self.assertEqual([(event["type"], event["detail"].split(":")[0], event["outcome"]) for event in events_of(self.take)[2:]], [
            ("fixity check", "verify --catalogue", "success"), ("fixity check", "verify --depth hashes", "success"),
            ("metadata modification", "plan epi --write", "success"), ("fixity check", "verify --catalogue", "success"),
            ("fixity check", "verify --catalogue", "failure"), ("fixity check", "bag", "failure")])

    def test_a_killed_command_leaves_no_event_and_the_digest_shows_what_it_changed(self) -> None:
        before = events_of(self.take)
        process = subprocess.Popen([BIN / "raystage", "verify", self.take, "-q"], stdin=subprocess.DEVNULL,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        process.kill()
        process.wait()
        self.assertEqual(events_of(self.take), before)
        # What changed the take without an event is seen in the next one.
        run("verify", self.take, "-q")
        document = json.loads((self.take / "take.json").read_text())
        (self.take / "take.json").write_text(json.dumps(document))
        run("verify", self.take, "-q")
        last = events_of(self.take)
        self.assertEqual(last[-2]["sha256"], before[-1]["sha256"])
        self.assertNotEqual(last[-1]["sha256"], last[-2]["sha256"])

    def test_events_can_be_turned_off(self) -> None:
        before = files_of(self.take)
        subprocess.run([BIN / "raystage", "verify", self.take, "-q"], env=os.environ | {"RAYSTAGE_EVENT_LOG": "0"},
                       stdin=subprocess.DEVNULL, capture_output=True, check=True)
        self.assertEqual(files_of(self.take), before)

    def test_a_killed_command_leaves_the_take_and_no_half_bag(self) -> None:
        before = files_of(self.take)
        bag = self.root / "bag"
        chance = random.Random(20051)
        outcomes = collections.Counter()
        for _ in range(40):
            process = subprocess.Popen([BIN / "raystage-bag", self.take, "-o", bag, "-q"], stdin=subprocess.DEVNULL,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(chance.uniform(0, 0.12))
            process.send_signal(signal.SIGKILL)
            process.wait()
            outcomes[bag.exists()] += 1
            after = files_of(self.take)
            self.assertTrue(after.pop("events.jsonl").startswith(before["events.jsonl"]))
            self.assertEqual(after, {name: data for name, data in before.items() if name != "events.jsonl"})
            if bag.exists():
                check_bag(bag)
                shutil.rmtree(bag)
        self.assertGreater(outcomes[False], 0)
        run("bag", self.take, "-o", bag, "-q")
        check_bag(bag)
        self.assertTrue(all(line for line in events_of(self.take)))
        self.assertEqual(self.leftovers(), [])

    def leftovers(self) -> list[str]:
        return sorted(entry.name for entry in self.root.iterdir() if entry.name.startswith("."))

    def kill_when(self, target: pathlib.Path, written: str, *arguments: object) -> None:
        """Kills a command when it has written a file of this name in its hidden folder, and leaves that behind."""
        process = subprocess.Popen([BIN / "raystage", *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        while process.poll() is None and not list(self.root.glob(f".{target.name}.*.tmp/{written}")):
            time.sleep(0.0005)
        process.kill()
        process.wait()
        if target.exists():  # it was faster
            shutil.rmtree(target)

    def test_the_next_run_removes_what_a_killed_one_left(self) -> None:
        packed, images = self.root / "packed", self.root / "images"
        commands = {
            self.root / "bag": ("bag", self.take, "-o", self.root / "bag", "-q"),
            self.root / "object": ("bag", self.take, "--ocfl", "-o", self.root / "object", "-q"),
            packed: ("pack", self.take, "-o", packed, "-q", "--effort", 1),
            images: ("export", "images", self.take, "-o", images, "-q", "--times", "recorded"),
        }
        moments = {"bag": ("", "data/archive/*", "premis.xml", "tagmanifest-sha256.txt"), "object": ("v1/content/data/*",),
                   "packed": ("archive/*",), "images": ("*",)}
        for target, command in commands.items():
            left = 0
            for moment in moments[target.name]:
                for _ in range(5):
                    self.kill_when(target, moment, *command)
                    found = self.leftovers()
                    self.assertLessEqual(len(found), 1, "each run removes what the one before left")
                    left += len(found)
            self.assertGreater(left, 0, target.name)
            # Those of other targets and of other hosts, and links, stay.
            kept = [f".{target.name}x.host.1.0123.tmp", f".{target.name}.other-host.999999.0123.tmp"]
            for name in kept:
                (self.root / name).mkdir()
            run(*command)
            self.assertEqual(self.leftovers(), sorted(kept))
            for name in kept:
                (self.root / name).rmdir()
        check_bag(self.root / "bag")
        check_object(self.root / "object")

    def test_exit_codes(self) -> None:
        bag = self.root / "bag"
        for arguments in ((self.take,), (self.take, "-o", bag, "--check", "quick"), ("--check", "quick", self.take, "--ocfl"),
                          ("--check", "all", self.take), ("--check", "quick", self.take), (self.root / "none", "-o", bag),
                          (self.take, "-o", self.take), (self.take, "-o", self.take / "bag"),
                          (self.take, "-o", bag, "--info", "Payload-Oxum: 1.1"), (self.take, "-o", bag, "--info", "no colon\n")):
            run("bag", *arguments, code=2)
            self.assertFalse(bag.exists())
        run("bag", self.take, "-o", bag, "-q")
        (bag / "data/more").write_text("x")
        for level in ("quick", "completeness", "checksums"):
            report = json.loads(run("bag", "--check", level, bag, "--json", code=1))
            self.assertFalse(report["valid"])
        self.assertIn("data/more: no payload manifest lists it", run("bag", "--check", "completeness", bag, code=1))


if __name__ == "__main__":
    unittest.main()
