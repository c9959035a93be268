#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Compares methods where artists look: at edges of depth, at thin structures and on planes.

Simulates the scenes with cameras of 480 x 320 pixels, and views of 312 x 208, whose pixels are about as
large as those of the cameras. Prints a table with a row for each scene and method (raystage evaluate,
docs/formats/evaluation.md).

usage: RAYSTAGE_BIN_DIR=build/release/bin regions.py [--scenes SCENE...] [--methods METHOD...] [--out FOLDER]
"""

import argparse
import json
import os
import pathlib
import subprocess
import tempfile

SECONDS = {"stage": 1.2}  # of takes; still ones need one frame


def run(*arguments):
    program = pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"]) / "raystage"
    return subprocess.run([program, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


def measure(take, method, exact, pictures):
    """Returns the mean of an evaluation; keeps its views in a folder. `exact`: at the times of the views, or the nearest ticks."""
    result = pathlib.Path(take) / "evaluation.json"
    run("evaluate", take, take / "views.json", "-q", "--method", method, "--no-pixel-counts", "--json", result,
        *(["--exact-times"] if exact else []), *(["--out", pictures] if pictures else []))
    return json.loads(result.read_text())["mean"]


def row(scene, method, mean):
    regions = mean["regions"]
    edges, thin = regions["edge_band"], regions["thin"]
    return (f"| {scene} | {method} | {mean['psnr_db']:.2f} | {edges['psnr_db']:.2f} | {edges['ms_ssim']:.4f} | "
            f"{thin['psnr_db']:.2f} | {thin['ms_ssim']:.4f} | {100 * regions['bad_depths_half_px']:.2f} | "
            f"{100 * regions['bad_depths_1_px']:.2f} | {regions['plane_rms_px']:.3f} | "
            f"{regions['edge_alpha']:.3f} | {regions['edge_alpha_gradient']:.3f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--scenes", nargs="+", default=["still", "stage"])
    parser.add_argument("--methods", nargs="+", default=["focal_plane", "plane_sweep", "depth"])
    parser.add_argument("--out", type=pathlib.Path, help="keep the rendered views here, FOLDER/SCENE/METHOD/VIEW.png")
    options = parser.parse_args()
    print("| scene | method | PSNR, dB | edges, dB | edges, MS-SSIM | thin, dB | thin, MS-SSIM | "
          "bad depths 0.5 px, % | 1 px, % | planes, px RMS | alpha error | of its gradient |")
    print("| --- | --- |" + " --: |" * 10)
    for scene in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            take = pathlib.Path(folder) / "take"
            run("simulate", scene, "-q", "-o", take, "--seconds", SECONDS.get(scene, 0.6), "--width", 480, "--height",
                320, "--truth-width", 312, "--truth-height", 208, "--truth-views", 8)
            run("sync", take)
            for method in options.methods:
                for exact in [False, True] if scene in SECONDS else [False]:
                    name = method + (", exact times" if exact else "")
                    pictures = options.out / scene / name if options.out else None
                    print(row(scene, name, measure(take, method, exact, pictures)), flush=True)


if __name__ == "__main__":
    main()
