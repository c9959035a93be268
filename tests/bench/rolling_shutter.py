#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Measures how far the correction of a rolling shutter reaches the global one.

Simulates the moving stage with 64 cameras of 480 x 320 pixels at 15 Hz, with a global shutter and with one that reads a
frame in 15 ms. Prints the PSNR of the true views at exact times: of the global shutter, of the rolling one as if it were
global (no line time in rig.json), and of the corrected one. The share is that of the loss in dB which the correction gains.

With --light it measures how well calibration finds the line time from a moving light instead.

usage: RAYSTAGE_BIN_DIR=build/release/bin rolling_shutter.py [--methods METHOD...] [--read-out-ms MS] [--out FOLDER] | --light
"""

import argparse
import json
import pathlib
import shutil
import tempfile

from rendered_frames import run

HEIGHT = 320


def psnr(take, method, pictures):
    """Returns the mean PSNR of the true views, rendered at their own times."""
    result = take / "evaluation.json"
    run("evaluate", take, take / "views.json", "-q", "--method", method, "--no-pixel-counts", "--json", result, "--exact-times",
        *(["--out", pictures] if pictures else []))
    return json.loads(result.read_text())["mean"]["psnr_db"]


def simulated(folder, line_time_us, options):
    """Simulates and synchronises a take without clock offsets, which would hide what a shutter does."""
    run("simulate", "stage", "-q", "-o", folder, "--seconds", options.seconds, "--fps", options.fps, "--width", 480, "--height",
        HEIGHT, "--truth-width", 312, "--truth-height", 208, "--truth-views", options.views, "--clock-offset-ms", 0,
        "--line-time-us", line_time_us)
    run("sync", folder)
    return folder


def without_line_times(take, folder):
    """Returns a copy of a take whose rig states no line times: all cameras count as global shutters."""
    shutil.copytree(take, folder)
    rig = json.loads((folder / "rig.json").read_text())
    for camera in rig["cameras"]:
        del camera["line_time_us"]
    (folder / "rig.json").write_text(json.dumps(rig))
    return folder


def find_line_times(base, read_out_ms):
    """Calibrates 3 x 4 cameras from a moving light, and prints the line time that was found."""
    print("| seed | line time, us | found, us | deviation, us | error, % | RMS, px |\n| --- | --: | --: | --: | --: | --: |")
    for seed in (1, 2, 3):
        take, height = base / f"light{seed}", 480
        line_time_us = 1000 * read_out_ms / height
        run("simulate", "moving_light", "-q", "-o", take, "--seed", seed, "--rows", 3, "--columns", 4, "--width", 640, "--height", height,
            "--mounting-mm", 5, "--mounting-deg", 4, "--calibration", "nominal", "--truth-views", 0, "--seconds", 14, "--fps", 10,
            "--line-time-us", line_time_us)
        report = json.loads(run("calibrate", "geometry", take, "--lens-per-camera", "--spacing-mm", 60, "-q", "--json", "-o",
                                base / f"rig{seed}.json"))
        found = report["cameras"][0]["line_time"]
        error = 100 * (found["us"] / line_time_us - 1)
        print(f"| {seed} | {line_time_us:.2f} | {found['us']:.2f} | {found['deviation_us']:.2f} | {error:.1f} | {report['rms_px']:.3f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--methods", nargs="+", default=["plane_sweep", "depth", "focal_plane"])
    parser.add_argument("--read-out-ms", type=float, default=15)
    parser.add_argument("--fps", type=float, default=15)
    parser.add_argument("--seconds", type=float, default=1.8, help="of the takes")
    parser.add_argument("--views", type=int, default=8)
    parser.add_argument("--out", type=pathlib.Path, help="keep takes and rendered views here")
    parser.add_argument("--light", action="store_true", help="find the line time from a moving light")
    options = parser.parse_args()
    if options.light:
        with tempfile.TemporaryDirectory() as temporary:
            find_line_times(options.out or pathlib.Path(temporary), options.read_out_ms)
        return
    print("| method | global, dB | rolling, dB | corrected, dB | share of the loss, % |\n| --- | --: | --: | --: | --: |")
    with tempfile.TemporaryDirectory() as temporary:
        base = options.out or pathlib.Path(temporary)
        takes = {"global": simulated(base / "global", 0, options),
                 "corrected": simulated(base / "corrected", 1000 * options.read_out_ms / HEIGHT, options)}
        takes["rolling"] = without_line_times(takes["corrected"], base / "rolling")
        for method in options.methods:
            db = {name: psnr(take, method, options.out and base / f"{name} {method}") for name, take in takes.items()}
            share = 100 * (db["corrected"] - db["rolling"]) / (db["global"] - db["rolling"])
            print(f"| {method} | {db['global']:.2f} | {db['rolling']:.2f} | {db['corrected']:.2f} | {share:.0f} |", flush=True)


if __name__ == "__main__":
    main()
