#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Measures lossless recompression: bytes saved, speed both ways, and the time of views from packed takes.

Imports shop, stanford_chess9x9, stage and four_webcams from the data folder and simulates the stage; packs each take with one
thread, unpacks it and compares all frames with the source. Then renders a shot of up to 48 frames (the size of the take, a camera that
moves in the middle quarter of the array; of a still light field all show one instant, of others each shows another tick) from the JPEG take and from the packed one, and compares the files byte for byte. Times of
shots and MB/s are processor seconds of all processes, sandboxed ones too, with one thread. Prints two tables.

usage: RAYSTAGE_BIN_DIR=build/check/bin pack.py [--data FOLDER] [--sets SET...] [--efforts EFFORT...] [--methods METHOD...]
       [--work FOLDER: keeps the takes and uses those that are there]
"""

import argparse
import ctypes
import filecmp
import json
import os
import pathlib
import resource
import shutil
import subprocess
import tempfile
import time

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
SETS = ("shop", "stanford_chess9x9", "stage", "four_webcams", "simulated")
WITH_VIEWS = ("shop", "stanford_chess9x9", "stage", "simulated")  # four webcams are no array to render from
FRAMES = 48


def run(*arguments):
    program = pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"]) / "raystage"
    return subprocess.run([program, *map(str, arguments)], check=True, capture_output=True, text=True,
                          stdin=subprocess.DEVNULL).stdout


def measured(*arguments):
    """Returns what a command prints, and its wall and processor seconds with all processes that it started."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    text = run(*arguments)
    end = time.monotonic()
    try:
        while True:  # decoders that outlive their command by a moment
            os.waitpid(-1, 0)
    except ChildProcessError:
        pass
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return text, end - start, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def become_parent_of_orphans():
    ctypes.CDLL(None, use_errno=True).prctl(36, 1, 0, 0, 0)  # PR_SET_CHILD_SUBREAPER


def make_take(name, data, take):
    if take.exists():
        return
    if name == "simulated":
        run("simulate", "stage", "-o", take, "-q", "--seed", 7, "--seconds", 4, "--truth-views", 0)
    else:
        run("import", data / name / "import.json", "-o", take, "--restart-markers")
    if name in WITH_VIEWS:
        run("sync", take, "-q")


def frames_are_equal(take, other):
    """Whether all archives and journals are the same bytes."""
    names = sorted(path.name for path in (take / "archive").iterdir())
    return all(filecmp.cmp(take / "archive" / name, other / "archive" / name, shallow=False) for name in names)


def packed_row(name, take, work, effort):
    """Packs and unpacks with one thread and prints a row."""
    packed, again = work / f"{name}_packed_{effort}", work / f"{name}_again"
    for folder in (packed, again):
        shutil.rmtree(folder, ignore_errors=True)
    text, _, pack_seconds = measured("pack", take, "-o", packed, "-q", "--json", "--threads", 1, "--effort", effort)
    there = json.loads(text)
    text, _, unpack_seconds = measured("unpack", packed, "-o", again, "-q", "--json", "--threads", 1)
    megabytes = there["bytes_before"] / 1e6
    equal = frames_are_equal(take, again)
    shutil.rmtree(again)
    saved = 100 * (1 - there["bytes_after"] / there["bytes_before"])
    print(f"| {name} | {effort} | {there['frames']} | {there['frames'] - there['packed']} | {megabytes:.1f} "
          f"| {there['bytes_after'] / 1e6:.1f} | {saved:.1f} % | {megabytes / pack_seconds:.1f} "
          f"| {megabytes / unpack_seconds:.1f} | {'yes' if equal else 'NO'} |", flush=True)
    return packed, saved


def frames_of(take):
    """Returns how many frames a shot of a take has: each shows another tick, if there are several."""
    ticks = json.loads(run("info", take, "--json"))["timeline"]["ticks"]
    return FRAMES if ticks == 1 else min(FRAMES, ticks)


def shot_of(take, method):
    """A shot from between the cameras in the middle of the array; the take plays if it has several frames."""
    frames = frames_of(take)
    rig = json.loads((take / "rig.json").read_text())
    poses = [camera["world_from_camera"] for camera in rig["cameras"]]
    rows = [[pose[i][3] for pose in poses] for i in range(3)]
    middle = [(min(row) + max(row)) / 2 for row in rows]
    step = [(max(row) - min(row)) / 8 for row in rows]
    camera = rig["cameras"][len(poses) // 2]
    shot = json.loads((REPOSITORY / "docs/shots/track.json").read_text())
    shot["width"], shot["height"], shot["last_frame"] = camera["width"], camera["height"], frames
    keys = shot["camera"]["keys"][:1] + shot["camera"]["keys"][-1:]
    for key, frame, part in zip(keys, (1, frames), (-1, 1)):
        key["frame"], key["position"] = frame, [m + part * s for m, s in zip(middle, step)]
    shot["camera"]["keys"] = keys
    shot["layers"][0].update(take=str(take), method=method)
    return shot


def view_row(name, take, packed, method, work):
    seconds = []
    for source in (take, packed):
        out = work / f"view_{name}_{source.name}"
        shutil.rmtree(out, ignore_errors=True)
        # The same path for both: fingerprints in the files state it.
        link = work / "take"
        link.unlink(missing_ok=True)
        link.symlink_to(source.resolve())
        file = work / "shot.json"
        file.write_text(json.dumps(shot_of(link, method)))
        arguments = ("render", file, "-o", out / "f.####.exr", "--progress", "none", "--threads", 1)
        run(*arguments)  # depths are stored, files are in the kernel's cache
        shutil.rmtree(out)
        seconds.append(min(measured(*arguments, "--existing", "overwrite")[1:] for _ in range(2)))
    first, second = (work / f"view_{name}_{source.name}" for source in (take, packed))
    equal = all(filecmp.cmp(path, second / path.name, shallow=False) for path in first.iterdir())
    (jpeg_wall, jpeg), (packed_wall, other) = seconds
    frames = frames_of(take)
    print(f"| {name} | {method} | {frames} | {1e3 * jpeg / frames:.1f} | {1e3 * other / frames:.1f} | {other / jpeg:.2f} "
          f"| {packed_wall / jpeg_wall:.2f} | {'yes' if equal else 'NO'} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=pathlib.Path, default=os.environ.get("RAYSTAGE_DATA", REPOSITORY.parent / "shared/data"))
    parser.add_argument("--sets", nargs="+", default=SETS)
    parser.add_argument("--efforts", nargs="+", type=int, default=[7])
    parser.add_argument("--methods", nargs="+", default=["focal_plane", "plane_sweep", "depth"])
    parser.add_argument("--work", type=pathlib.Path)
    options = parser.parse_args()
    become_parent_of_orphans()
    with tempfile.TemporaryDirectory() as folder:
        work = (options.work or pathlib.Path(folder)).resolve()
        work.mkdir(parents=True, exist_ok=True)
        print("| take | effort | frames | stay JPEG | MB before | MB after | saved | pack MB/s | unpack MB/s | bit for bit |")
        print("| --- | --: | --: | --: | --: | --: | --: | --: | --: | --- |")
        packed, saved = {}, {effort: [] for effort in options.efforts}
        for name in options.sets:
            make_take(name, options.data, work / name)
            for effort in options.efforts:
                packed[name], part = packed_row(name, work / name, work, effort)
                saved[effort].append(part)
        for effort, parts in saved.items():
            print(f"\nMean saved at effort {effort}: {sum(parts) / len(parts):.1f} %")
        print("\n| take | method | views | JPEG, CPU ms a view | packed | times | times, wall | same files |")
        print("| --- | --- | --: | --: | --: | --: | --: | --- |")
        for name in (name for name in options.sets if name in WITH_VIEWS):
            for method in options.methods:
                view_row(name, work / name, packed[name], method, work)


if __name__ == "__main__":
    main()
