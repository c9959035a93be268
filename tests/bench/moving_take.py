#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Measures the processor time of a shot that plays a take, by stage: depths (raystage prepare) and views (raystage render).

Simulates the moving stage with 64 cameras of 480 x 320 pixels and renders 48 frames of docs/shots/track.json, each of another tick, in
that size. Prints a row for each program and option: CPU seconds a frame, the depths stored, and the quotient with the first row.

usage: moving_take.py [--bins FOLDER...] [--options JSON...] [--take TAKE]
"""

import argparse
import json
import os
import pathlib
import resource
import subprocess
import tempfile

FRAMES = 48
REPOSITORY = pathlib.Path(__file__).resolve().parents[2]


def processor_seconds(*arguments):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([*map(str, arguments)], check=True, capture_output=True, stdin=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def shot_of(take, options):
    shot = json.loads((REPOSITORY / "docs/shots/track.json").read_text())
    shot["width"], shot["height"], shot["last_frame"] = 480, 320, FRAMES
    for key, frame in zip(shot["camera"]["keys"], (1, FRAMES // 2, FRAMES)):
        key["frame"] = frame
    shot["layers"][0]["take"] = str(take)
    shot["layers"][0]["options"] = options
    return shot


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--bins", nargs="+", type=pathlib.Path, default=[pathlib.Path(os.environ.get("RAYSTAGE_BIN_DIR", "."))],
                        help="folders of the programs to compare, the first is the one to divide by")
    parser.add_argument("--options", nargs="+", default=["{}"], help="options of depth, JSON")
    parser.add_argument("--take", type=pathlib.Path, help="the simulated take; it is made there if it is missing")
    arguments = parser.parse_args()
    print("| program | options | depths, s a frame | views, s a frame | together | quotient | stored, MB |")
    print("| --- | --- | --: | --: | --: | --: | --: |")
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        take = (arguments.take or folder / "take").resolve()
        if not take.exists():
            processor_seconds(arguments.bins[0] / "raystage", "simulate", "stage", "-q", "-o", take, "--width", 480, "--height", 320, "--seconds",
                              4.2)
            processor_seconds(arguments.bins[0] / "raystage", "sync", take)
        first = None
        for number, (binary, options) in enumerate((b, o) for b in arguments.bins for o in arguments.options):
            program, cache = binary / "raystage", folder / f"cache{number}"
            shot = folder / f"shot{number}.json"
            shot.write_text(json.dumps(shot_of(take, json.loads(options))))
            depths = processor_seconds(program, "prepare", shot, "-q", "--cache", cache)
            views = processor_seconds(program, "render", shot, "-q", "--cache", cache, "-o", folder / f"out{number}" / "f.####.exr")
            stored = sum(file.stat().st_size for file in cache.rglob("*.zst")) / 1e6
            together = depths + views
            first = first or together
            print(f"| {binary} | {options} | {depths / FRAMES:.2f} | {views / FRAMES:.2f} | {together / FRAMES:.2f} | {first / together:.2f} | "
                  f"{stored:.0f} |", flush=True)


if __name__ == "__main__":
    main()
