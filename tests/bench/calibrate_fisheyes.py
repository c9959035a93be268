#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures calibrations of fisheyes with simulated takes of known truth: arrays from a light that is
carried around them, and the comparison of lens models by a board.

Usage: tests/bench/calibrate_fisheyes.py [FOLDER]     (default: a temporary folder)
`raystage` must be on the PATH. Takes some minutes.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
folder.mkdir(parents=True, exist_ok=True)


def raystage(*arguments):
    command = ["raystage", *map(str, arguments)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True).stdout


def simulate(scene, take, *options):
    if not (take / "truth.json").exists():
        raystage("simulate", scene, "-o", take, "--truth-views", 0, "--startup-loss-seconds", 0.2, "--calibration",
                 "nominal", "-q", *options)
    truth = take.with_suffix(".true.json")
    truth.write_text(json.dumps(json.loads((take / "truth.json").read_text())["rig"]))
    return truth


print("## 12 cameras of 400x400, mounted up to 8 degrees off, from a light around them")
for lens, fov in [("ftheta", 200), ("equisolid", 200), ("orthographic", 178)]:
    take = folder / f"light_{lens}"
    truth = simulate("moving_light_around", take, "--lens", lens, "--fov-deg", fov, "--rows", 3, "--columns", 4,
                     "--width", 400, "--height", 400, "--seconds", 20, "--fps", 10, "--mounting-deg", 8,
                     "--mounting-mm", 5, "--lens-deviation", 0, "--cameras-per-node", 4)
    rig = folder / f"{lens}.json"
    report = json.loads(raystage("calibrate", "geometry", take, "--spacing-mm", 60, "-o", rig, "-q", "--json"))
    cameras = json.loads(raystage("calibrate", "compare", "--json", truth, rig))["cameras"]
    true_f = json.loads(truth.read_text())["cameras"][0]["intrinsics"]["fx"]
    found, deviation = (report["cameras"][0][key]["fx"] for key in ("lens", "lens_deviation"))
    print(f"{lens} {fov}: {report['rms_px']:.3f} px RMS, positions within "
          f"{1000 * max(c['position_m'] for c in cameras):.2f} mm, directions within "
          f"{max(c['rotation_deg'] for c in cameras):.3f} degrees, focal length {100 * (found / true_f - 1):+.3f} % "
          f"(deviation {100 * deviation / true_f:.3f} %)")

print("## 3 cameras of 900x900 with lenses that differ, from a board around them")
for lens, fov in [("pinhole", 100), ("ftheta", 200), ("equisolid", 200), ("orthographic", 170)]:
    take = folder / f"board_{lens}"
    truth = simulate("board_around", take, "--lens", lens, "--fov-deg", fov, "--rows", 1, "--columns", 3, "--width",
                     900, "--height", 900, "--seconds", 16, "--fps", 6)
    true_lenses = {c["id"]: c["intrinsics"] for c in json.loads(truth.read_text())["cameras"]}
    report = json.loads(raystage("calibrate", "lens", take, "--board", "10x7", "--square-mm", 30, "-q", "-o",
                                 folder / f"lens_{lens}.json", "--lens-model", "auto", "--force", "--json"))
    for camera in report["cameras"]:
        models = ", ".join(
            f"{m['projection']} {m['held_out_rms_px']:.3f} px ({m['rank']})" if "rank" in m else
            f"{m['projection']} does not fit" for m in camera["models"])
        focal = camera["lens"]["fx"] / true_lenses[camera["id"]]["fx"] - 1
        print(f"{lens} {fov}, {camera['id']}, {camera['views']} views: {models}; focal length {100 * focal:+.3f} %")
