#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reads, verifies and renders the takes that earlier versions wrote, with the programs in RAYSTAGE_BIN_DIR.

Usage: golden_test.py [--complete VERSION]

Each folder next to this file is a golden take (README.md). Checked are:
  * every byte is as it was committed (SHA256SUMS), and no file was added;
  * the versions that versions.json states are those that the files have;
  * `raystage verify --decode` finds the take intact, `raystage info` counts the stated frames;
  * the shot renders to picture.png within the tolerance below;
  * every version of a format of takes that the source knows has a golden take.
--complete VERSION writes versions.json, picture.png and SHA256SUMS of a folder that has none of them.
"""
import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy

GOLDEN = pathlib.Path(__file__).resolve().parent
SOURCE = GOLDEN.parent.parent
BIN = pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"])
MEAN_TOLERANCE, MAX_TOLERANCE = 0.5, 4  # of 255, on the sRGB curve: libraries of JPEG and kernels round differently
WRITTEN = {"versions.json", "picture.png", "SHA256SUMS"}
# Kinds of documents that are part of a take or of the shot that renders it.
KINDS = {"take", "rig", "shot", "recording", "views", "event", "imported_depths"}
# Codecs of archives (docs/formats/archive.md).
FORMS = {b"V_MJPEG": "JPEG", b"V_JPEGXL": "packed", b"V_JPEGXL/PICTURE": "pictures", b"V_MPEGH/ISO/HEVC": "HEVC", b"V_AV1": "AV1",
         b"V_MPEGH/ISO/HEVC/CAMERAS": "HEVC across cameras", b"V_AV1/CAMERAS": "AV1 across cameras"}


def output_of(*command: object, stdin: bytes | None = None) -> bytes:
    environment = os.environ | {"RAYSTAGE_EVENT_LOG": "0"}  # golden takes stay as they are
    done = subprocess.run([str(word) for word in command], input=stdin, capture_output=True, check=False, env=environment)
    if done.returncode != 0:
        raise AssertionError(f"{command}: exit code {done.returncode}\n{done.stdout.decode()}{done.stderr.decode()}")
    return done.stdout


def raystage(*words: object) -> bytes:
    return output_of(BIN / "raystage", *words)


def sums(folder: pathlib.Path) -> dict[str, str]:
    """Returns the SHA-256 of every file by its relative path."""
    return {str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest()
            for file in sorted(folder.rglob("*")) if file.is_file() and file.name != "SHA256SUMS"}


def number_at(data: bytes, at: int) -> int:
    return int.from_bytes(data[at:at + 4], "little")


def versions_of(folder: pathlib.Path) -> dict[str, list[int] | list[str]]:
    """Returns the versions of the formats that the files of a golden take have, read from their bytes."""
    found: dict[str, set] = {}
    for file in sorted(folder.rglob("*")):
        if file.name in WRITTEN or not file.is_file():
            continue
        data = file.read_bytes()
        if file.suffix == ".json":
            schema = json.loads(data).get("schema", "")
            kind, version = re.fullmatch(r"raystage/([\w-]+)/(\d+)", schema).groups()
            found.setdefault(kind, set()).add(int(version))
        elif file.suffix == ".jsonl":
            for line in data.splitlines():
                kind, version = re.fullmatch(r"raystage/([\w-]+)/(\d+)", json.loads(line)["schema"]).groups()
                found.setdefault(kind, set()).add(int(version))
        elif file.suffix == ".journal":
            found.setdefault("journal", set()).add(number_at(data, 8))
        elif file.name == "timeline.zst":
            found.setdefault("timeline", set()).add(number_at(output_of("zstd", "-dcq", stdin=data), 8))
        elif file.suffix == ".zst":
            found.setdefault("depth", set()).add(number_at(output_of("zstd", "-dcq", stdin=data), 8))
        elif file.name == "manifest.sha256":
            found.setdefault("manifest", set()).add(data.split(b"\n", 1)[0].decode())
        elif file.suffix == ".mkv":
            head = data[:data.index(bytes.fromhex("1f43b675"))]  # up to the first Cluster
            form = FORMS[re.search(rb"V_[A-Z0-9/]+", head)[0]]
            # DefaultDuration, or the Void of 12 bytes that becomes it.
            has_space = bytes.fromhex("23e383") in head or bytes.fromhex("ec0100000000000003") in head
            found.setdefault("archive", set()).add(f"{form}, {'with' if has_space else 'without'} space for the frame rate")
    return {kind: sorted(values) for kind, values in sorted(found.items())}


def versions_in_source() -> dict[str, set]:
    """Returns the versions that the source reads: those of its constants and schemas."""
    def constant(file: str) -> int:
        return int(re.search(r"constexpr std::uint32_t kVersion = (\d+)", (SOURCE / file).read_text())[1])

    found = {kind: set(range(1, constant(file) + 1)) for kind, file in {
        "journal": "store/journal.h", "timeline": "store/timeline_file.cpp", "depth": "render/depth/depth_file.cpp"}.items()}
    for file in (SOURCE / "schemas").glob("*.schema.json"):
        kind, version = json.loads(file.read_text())["$id"].split("/")[1:]
        if kind in KINDS:
            found.setdefault(kind, set()).add(int(version))
    codecs = re.findall(r'CodecName\{FrameCodec::\w+,\s*"([^"]+)"\}', (SOURCE / "store/matroska.cpp").read_text())
    assert {codec.encode() for codec in codecs} == FORMS.keys(), f"store/matroska.cpp has the codecs {codecs}"
    found["archive"] = {"JPEG, without space for the frame rate", "JPEG, with space for the frame rate",
                        *(f"{form}, with space for the frame rate" for form in FORMS.values())}
    first_line = re.search(r'"(# raystage/manifest/[0-9]+)"', (SOURCE / "store/fixity/manifest.cpp").read_text())
    assert first_line, "store/fixity/manifest.cpp states no first line of manifests"
    found["manifest"] = {first_line[1]}
    return found


def picture_of(file: pathlib.Path) -> numpy.ndarray:
    """Returns an EXR or PNG file as rows x columns x 3 codes of 0 to 255 on the sRGB curve."""
    probed = output_of("ffprobe", "-v", "error", "-select_streams", "v:0", "-show_entries", "stream=width,height", "-of", "csv=p=0", file)
    width, height = (int(word) for word in probed.decode().strip().split(",")[:2])
    if file.suffix == ".png":
        data = output_of("ffmpeg", "-nostdin", "-v", "error", "-i", file, "-f", "rawvideo", "-pix_fmt", "rgb24", "-")
        return numpy.frombuffer(data, numpy.uint8).reshape(height, width, 3).astype(float)
    data = output_of("ffmpeg", "-nostdin", "-v", "error", "-i", file, "-f", "rawvideo", "-pix_fmt", "gbrpf32le", "-")
    planes = numpy.frombuffer(data, numpy.float32).reshape(3, height, width)
    linear = numpy.clip(numpy.stack([planes[2], planes[0], planes[1]], axis=2).astype(float), 0, 1)
    return 255 * numpy.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def render(folder: pathlib.Path, temporary: pathlib.Path) -> numpy.ndarray:
    """Renders the shot of a copy of the golden take."""
    work = temporary / folder.name
    shutil.copytree(folder, work)
    raystage("render", work / "take" / "shot.json", "--progress", "none", "-o", temporary / f"{folder.name}.####.exr")
    [picture] = temporary.glob(f"{folder.name}.*.exr")
    return picture_of(picture)


def complete(folder: pathlib.Path) -> None:
    assert not any((folder / name).exists() for name in WRITTEN), f"{folder} is complete: golden takes are not changed"
    with tempfile.TemporaryDirectory() as temporary:
        codes = numpy.rint(render(folder, pathlib.Path(temporary))).astype(numpy.uint8)
    height, width, _ = codes.shape
    output_of("ffmpeg", "-nostdin", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-i", "-",
              folder / "picture.png", stdin=codes.tobytes())
    info = json.loads(raystage("info", "--json", folder / "take"))
    frames = sum(camera["frames"] for camera in info["cameras"])
    missing = sum(sum(camera["missing"].values()) for camera in info["cameras"])
    stated = {"formats": versions_of(folder), "cameras": len(info["cameras"]), "frames": frames, "missing": missing}
    (folder / "versions.json").write_text(json.dumps(stated, indent=2) + "\n")
    (folder / "SHA256SUMS").write_text("".join(f"{digest}  {name}\n" for name, digest in sums(folder).items()))


def check(folder: pathlib.Path, temporary: pathlib.Path) -> dict[str, list]:
    pinned = dict(reversed(line.split("  ", 1)) for line in (folder / "SHA256SUMS").read_text().splitlines())
    assert sums(folder) == pinned, f"{folder}: golden takes are never changed: {set(sums(folder).items()) ^ set(pinned.items())}"
    stated = json.loads((folder / "versions.json").read_text())
    assert versions_of(folder) == stated["formats"], f"{folder}: {versions_of(folder)}"
    raystage("verify", "--decode", "-q", folder / "take")
    if (folder / "take" / "manifest.sha256").exists():
        raystage("verify", "--manifest", "check", "-q", folder / "take")
    info = json.loads(raystage("info", "--json", folder / "take"))
    assert len(info["cameras"]) == stated["cameras"], folder
    assert sum(camera["frames"] for camera in info["cameras"]) == stated["frames"], folder
    assert sum(sum(camera["missing"].values()) for camera in info["cameras"]) == stated["missing"], folder
    difference = abs(render(folder, temporary) - picture_of(folder / "picture.png"))
    assert difference.mean() <= MEAN_TOLERANCE and difference.max() <= MAX_TOLERANCE, \
        f"{folder}: the picture differs by {difference.mean():.2f} codes in the mean, {difference.max():.2f} at most"
    print(f"{folder.name}: {stated['frames']} frames, the picture differs by {difference.mean():.3f} codes in the mean, "
          f"{difference.max():.2f} at most; {stated['formats']}")
    assert sums(folder) == pinned, f"{folder}: a command changed the take"
    return stated["formats"]


def main() -> None:
    if len(sys.argv) == 3 and sys.argv[1] == "--complete":
        complete(GOLDEN / sys.argv[2])
        return
    covered: dict[str, set] = {}
    folders = sorted(file.parent for file in GOLDEN.glob("*/SHA256SUMS"))
    assert folders == sorted(path for path in GOLDEN.iterdir() if path.is_dir() and path.name != "__pycache__"), \
        "a folder has no SHA256SUMS"
    with tempfile.TemporaryDirectory() as temporary:
        for folder in folders:
            for kind, versions in check(folder, pathlib.Path(temporary)).items():
                covered.setdefault(kind, set()).update(versions)
    for kind, versions in versions_in_source().items():
        assert versions <= covered.get(kind, set()), f"no golden take has {kind} {sorted(versions - covered.get(kind, set()))}: see README.md"


if __name__ == "__main__":
    main()
