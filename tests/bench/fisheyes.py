#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Compares arrays of fisheyes that look around with arrays of pinholes at the same places.

`sphere`: the 16 f-theta cameras of facebook360_dep's real rig (its rig.json in the data folder), with smaller pictures. `dome`:
46 of OpenCV's fisheyes on a hemisphere of 0.46 m radius that look outwards, 120 degrees wide. In the other array each fisheye is replaced by
pinholes at its place, five of 95 degrees or one of 120, which see the same with as many pixels per degree in the mean. Both see the built-in set, which
is a room, and are compared at the same views within the array. Prints PSNR and the pixels decoded for each that is needed, per method.

usage: RAYSTAGE_BIN_DIR=build/release/bin fisheyes.py [--rigs sphere dome] [--methods METHOD...] [--width PIXELS]
           [--view-width PIXELS] [--out FOLDER]
"""

import argparse
import json
import math
import os
import pathlib
import tempfile

import numpy as np

from rendered_frames import run




def turn(degrees, axis):
    """Returns a rotation about an axis of unit length."""
    angle = math.radians(degrees)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def pinholes_of(rig):
    """Returns a rig of pinholes for each fisheye: five, ahead and to its sides, for a hemisphere, otherwise one."""
    is_hemisphere = "half_angle" in rig["cameras"][0]["intrinsics"]
    half = math.radians(47.5 if is_hemisphere else 60)
    faces = [np.eye(3)]
    if is_hemisphere:
        faces += [turn(angle, axis) for axis in ([0, 1, 0], [1, 0, 0]) for angle in (90, -90)]
    cameras = []
    for camera in rig["cameras"]:
        lens = camera["intrinsics"]
        widest = lens.get("half_angle", math.radians(60))
        factors = lens.get("radial_distortion", [])
        distance = widest * (1 + sum(factor * widest ** (2 * i + 2) for i, factor in enumerate(factors)))
        focal = lens["fx"] * distance / widest * half / math.tan(half)
        width = round(2 * focal * math.tan(half))
        height = width if is_hemisphere else round(width * camera["height"] / camera["width"])
        for index, face in enumerate(faces):
            pose = np.array(camera["world_from_camera"])
            pose[:3, :3] = pose[:3, :3] @ face
            cameras.append({"id": f"{camera['id']}_{index}", "width": width, "height": height,
                            "intrinsics": {"fx": focal, "fy": focal, "cx": width / 2, "cy": height / 2},
                            "world_from_camera": pose.tolist()})
    return {"schema": "raystage/rig/1", "name": "pinholes", "cameras": cameras}


def dome():
    """Returns 46 fisheyes that are spread evenly over a hemisphere."""
    cameras, count = [], 46
    for index in range(count):
        ahead = 1 - (index + 0.5) / count
        across, around = math.sqrt(1 - ahead * ahead), 2 * math.pi * index * 2 / (1 + math.sqrt(5))
        forward = np.array([across * math.cos(around), across * math.sin(around), -ahead])
        right = np.cross(forward, [0, 1, 0] if abs(forward[1]) < 0.95 else [0, 0, 1])
        right /= np.linalg.norm(right)
        pose = np.eye(4)
        pose[:3, :3] = np.array([right, np.cross(right, forward), -forward]).T
        pose[:3, 3] = 0.46 * forward
        focal = 2560 / 2 / (math.radians(60) * (1 + 0.02 * math.radians(60) ** 2))
        cameras.append({"id": f"camera_{index + 1:04}", "width": 2560, "height": 1920,
                        "intrinsics": {"fx": focal, "fy": focal, "cx": 1280, "cy": 960, "projection": "fisheye",
                                       "radial_distortion": [0.02]},
                        "world_from_camera": pose.tolist()})
    return {"schema": "raystage/rig/2", "name": "dome", "cameras": cameras}


def sphere(base):
    """Returns facebook360_dep's rig."""
    data = os.environ.get("RAYSTAGE_DATA", pathlib.Path(__file__).resolve().parents[3] / "shared" / "data")
    file = base / "facebook360.json"
    if not file.exists():
        run("import", pathlib.Path(data) / "facebook360" / "rig.json", "--rig-only", "-o", file)
    return json.loads(file.read_text())


def measured(take, rig, width, view_width, method, views):
    """Simulates a take by a rig and returns the means of an evaluation at the views of a take."""
    if not take.exists():
        file = take.with_suffix(".json")
        file.write_text(json.dumps(rig))
        run("simulate", "still", "-q", "-o", take, "--rig", file, "--width", width, "--mounting-mm", 0, "--mounting-deg", 0,
            "--lens-deviation", 0, "--seconds", 0.34, "--startup-loss-seconds", 0, "--drop", 0, "--truth-width",
            view_width, "--truth-height", view_width * 3 // 4)
        run("sync", take)
    still = views / "still.json"
    document = json.loads((views / "views.json").read_text())
    for view in document["views"]:
        view["time_ns"] = 170_000_000  # nothing moves, and the ticks of the takes differ
    still.write_text(json.dumps(document))
    result = take / f"{method}.json"
    options = ["--option", "store_depths=false", "--option", "all_cameras=true"] if method == "depth" else []
    run("evaluate", take, still, "-q", "--method", method, *options, "--out", take / method, "--json", result)
    return json.loads(result.read_text())["mean"]


def as_text(value, scale=1, places=2):
    """Returns a measured number; evaluations have none where no pixel can be compared, or where a method counts none."""
    return "-" if value is None else f"{scale * value:.{places}f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rigs", nargs="+", default=["sphere", "dome"], choices=["sphere", "dome"])
    parser.add_argument("--methods", nargs="+", default=["plane_sweep", "depth"])
    parser.add_argument("--width", type=int, default=672, help="of the fisheyes' pictures, pixels")
    parser.add_argument("--view-width", type=int, default=240, help="of the views, pixels; they are 4:3")
    parser.add_argument("--out", type=pathlib.Path, help="folder that keeps the takes and views")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        base = arguments.out or pathlib.Path(temporary)
        base.mkdir(parents=True, exist_ok=True)
        print("| array | cameras | method | PSNR, dB | covered, % | decoded/needed |\n| --- | --: | --- | --: | --: | --: |")
        for name in arguments.rigs:
            fisheyes = sphere(base) if name == "sphere" else dome()
            pinholes = pinholes_of(fisheyes)
            scale = arguments.width / fisheyes["cameras"][0]["width"]
            arrays = [(name, fisheyes, arguments.width),
                      (f"{name}, pinholes", pinholes, round(pinholes["cameras"][0]["width"] * scale))]
            for label, rig, width in arrays:
                for method in arguments.methods:
                    mean = measured(base / label.replace(", ", "_"), rig, width, arguments.view_width, method, base / name)
                    print(f"| {label} | {len(rig['cameras'])} | {method} | {as_text(mean['psnr_db'])} | "
                          f"{as_text(mean['covered'], 100, 1)} | {as_text(mean['decoded_per_needed'])} |", flush=True)


if __name__ == "__main__":
    main()
