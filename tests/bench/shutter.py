#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Compares frames with motion blur with the truth.

Simulates the moving stage with views whose shutter is open for 180 degrees, and the still one without. Renders the
shots of both takes at the views' frames and prints their PSNR, with and without motion blur.

usage: RAYSTAGE_BIN_DIR=build/release/bin shutter.py [--method METHOD] [--shutter-deg ANGLE] [--out FOLDER]
"""

import argparse
import json
import math
import pathlib
import tempfile

import numpy as np

from rendered_frames import channels, run, srgb, view_frames

SIZE, VIEWS, FRAMES = (312, 208), 4, 24


def psnr(take, method, samples, folder):
    shot = json.loads((take / "shot.json").read_text())
    layer = shot["layers"][0]
    layer["take"], layer["method"], layer["time"] = str(take), method, "exact"
    layer.pop("focal_plane", None)
    shot["output"] = {"motion_samples": samples, "aovs": []}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "shot.json").write_text(json.dumps(shot))
    frames = view_frames(VIEWS, FRAMES)
    run("render", folder / "shot.json", "-o", folder / "a.####.exr", "--frames", ",".join(map(str, frames)), "-q",
        "--existing", "overwrite")
    squares = []
    for view, frame in enumerate(frames):
        truth = channels(take / f"truth/view{view:03}.png", "RGB", SIZE)
        squares.append(np.mean((srgb(channels(folder / f"a.{frame:04}.exr", "RGB", SIZE)) - truth) ** 2))
    return np.mean([-10 * math.log10(square) for square in squares])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--method", default="plane_sweep")
    parser.add_argument("--shutter-deg", type=float, default=180)
    parser.add_argument("--out", type=pathlib.Path, help="keep takes and frames here")
    options = parser.parse_args()
    print("| scene | shutter | rendered | PSNR, dB |\n| --- | --- | --- | --: |")
    with tempfile.TemporaryDirectory() as temporary:
        base = options.out or pathlib.Path(temporary)
        for scene, seconds, shutter in [("still", 0.6, 0), ("stage", 1.8, 0), ("stage", 1.8, options.shutter_deg)]:
            take = base / f"{scene} {shutter:g}"
            if not take.exists():
                run("simulate", scene, "-q", "-o", take, "--seconds", seconds, "--width", 480, "--height", 320,
                    "--truth-width", SIZE[0], "--truth-height", SIZE[1], "--truth-views", VIEWS, "--shot-frames", FRAMES,
                    "--fps", 15, "--truth-shutter-deg", shutter)
                run("sync", take)
            for samples in [33, 1] if shutter else [1]:
                folder = base / f"{take.name} {options.method} {samples}"
                what = "with motion blur" if samples > 1 else "sharp"
                print(f"| {scene} | {shutter:g} | {what} | {psnr(take, options.method, samples, folder):.2f} |", flush=True)


if __name__ == "__main__":
    main()
