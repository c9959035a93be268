#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Compares composites of a light field and a mesh, merged by depth, with the truth.

The simulator adds an unlit ball to the true views. The take, which has none, is rendered with a sphere in the same
place. Prints a table with a row for each scene, ball and method: PSNR in the band of 4 pixels about the visible
edge of the ball, mean and gradient error of its coverage there, and specks: pixels farther than 2 from that edge
where the ball is or is not, wrongly, by more than half.

usage: RAYSTAGE_BIN_DIR=build/release/bin composites.py [--scenes SCENE...] [--methods METHOD...] [--out FOLDER]
"""

import argparse
import json
import math
import pathlib
import shutil
import subprocess
import tempfile

import numpy as np

from rendered_frames import channels, linear, run, srgb, view_frames

SECONDS = {"stage": 1.2}
BALLS = {"behind the wheel": (-1.2, -0.55, -4.9, 0.3), "behind the flags": (-0.4, 1.1, -5.6, 0.35),
         "behind the fence": (0.6, -0.6, -7.15, 0.33)}
COLOUR = (0.75, 0.15, 0.6)
SIZE, VIEWS, FRAMES = (312, 208), 8, 48


def write_sphere(file, steps=96):
    """Writes a unit sphere as OBJ."""
    points = [(0, 1, 0), (0, -1, 0)]
    for i in range(1, steps):
        for j in range(2 * steps):
            a, b = math.pi * i / steps, math.pi * j / steps
            points.append((math.sin(a) * math.cos(b), math.cos(a), math.sin(a) * math.sin(b)))
    index = lambda i, j: 3 + (i - 1) * 2 * steps + j % (2 * steps)
    faces = []
    for j in range(2 * steps):
        faces += [(1, index(1, j + 1), index(1, j)), (2, index(steps - 1, j), index(steps - 1, j + 1))]
        for i in range(1, steps - 1):
            faces += [(index(i, j), index(i, j + 1), index(i + 1, j)), (index(i, j + 1), index(i + 1, j + 1), index(i + 1, j))]
    with open(file, "w", encoding="ascii") as out:
        out.write("o ball\n")
        out.writelines("v %.9g %.9g %.9g\n" % point for point in points)
        out.writelines("f %d %d %d\n" % face for face in faces)


def dilated(mask, radius):
    """Returns the pixels within a square around those of a mask."""
    for axis in (0, 1):
        grown = mask.copy()
        for shift in range(1, radius + 1):
            for sign in (-1, 1):
                moved = np.roll(mask, sign * shift, axis)
                edge = [slice(None), slice(None)]
                edge[axis] = slice(0, shift) if sign > 0 else slice(-shift, None)
                moved[tuple(edge)] = False
                grown |= moved
        mask = grown
    return mask


def edge_of(coverage):
    """Returns the pixels that the visible edge of the ball crosses, and their neighbours across it."""
    inside = coverage > 0.5
    edge = (coverage > 0.01) & (coverage < 0.99)
    for axis in (0, 1):
        other = np.roll(inside, 1, axis) != inside
        first = [slice(None), slice(None)]
        first[axis] = slice(0, 1)
        other[tuple(first)] = False
        edge |= other
    return edge


def gradient(values):
    return np.hypot(*np.gradient(values))


def compare(truth, ours):
    """Returns the errors of one frame. Both: (linear R, G, B, coverage of the ball)."""
    true_share, share = truth[..., 3], ours[..., 3]
    edge = edge_of(true_share)
    band = dilated(edge, 4)
    error = (srgb(ours[..., :3]) - srgb(truth[..., :3]))[band]
    specks = (np.abs(share - true_share) > 0.5) & ~dilated(edge, 2)
    return {"square": float(np.mean(error ** 2)), "alpha": float(np.mean(np.abs(share - true_share)[band])),
            "gradient": float(np.mean(np.abs(gradient(share) - gradient(true_share))[band])), "specks": int(specks.sum())}


def render(take, ball, method, frames, folder):
    shot = json.loads((take / "shot.json").read_text())
    simulated = shot["layers"][0]
    shot["layers"][0] = {"name": "take", "take": str(take), "method": method, "speed": simulated.get("speed", 1),
                         "start_seconds": simulated.get("start_seconds", 0)}
    x, y, z, radius = ball
    shot["layers"].append({"name": "ball", "geometry": {
        "file": "sphere.obj", "keys": [{"frame": 1, "position": [x, y, z], "scale": radius}], "samples": 16,
        "material": {"kind": "diffuse", "color": list(COLOUR)}}})
    shot["lights"] = [{"ambient": [1, 1, 1]}]
    shot["merge"] = "depth"
    shot["output"] = {"cryptomatte": True, "aovs": []}
    if "exact" in folder.name:
        shot["layers"][0]["time"] = "exact"
    folder.mkdir(parents=True)
    write_sphere(folder / "sphere.obj")
    (folder / "shot.json").write_text(json.dumps(shot))
    run("render", folder / "shot.json", "-o", folder / "a.####.exr", "--frames", ",".join(map(str, frames)), "-q",
        "--existing", "overwrite")


def ball_coverage(file):
    """Returns the coverage of the object "ball/ball" by the ids of Cryptomatte."""
    names = [f"CryptoObject{part:02}.{channel}" for part in range(3) for channel in "RGBA"]
    values = channels(file, names, SIZE)
    header = subprocess.run(["oiiotool", "--info", "-v", str(file)], check=True, capture_output=True, text=True).stdout
    manifest = next(line for line in header.splitlines() if "/manifest" in line)
    manifest = json.loads(manifest.split(": ", 1)[1].strip().strip('"').replace('\\"', '"'))
    wanted = next(value for name, value in manifest.items() if name.startswith("ball"))
    wanted = np.frombuffer(int(wanted, 16).to_bytes(4, "little"), "<f4")[0]
    share = np.zeros(values.shape[:2])
    for rank in range(6):
        share += np.where(values[..., 2 * rank].astype("f4") == wanted, values[..., 2 * rank + 1], 0)
    return share


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--scenes", nargs="+", default=["still", "stage"])
    parser.add_argument("--methods", nargs="+", default=["plane_sweep", "depth"])
    parser.add_argument("--out", type=pathlib.Path, help="keep takes and pictures here")
    options = parser.parse_args()
    frames = view_frames(VIEWS, FRAMES)
    print("| scene | ball | method | band, dB | coverage error | gradient error | specks, pixels a frame: mean | most |")
    print("| --- | --- | --- |" + " --: |" * 5)
    for scene in options.scenes:
        for name, ball in BALLS.items():
            with tempfile.TemporaryDirectory() as temporary:
                take = (options.out or pathlib.Path(temporary)) / f"{scene} {name}"
                if not take.exists():
                    run("simulate", scene, "-q", "-o", take, "--seconds", SECONDS.get(scene, 0.6), "--width", 480,
                        "--height", 320, "--truth-width", SIZE[0], "--truth-height", SIZE[1], "--truth-views", VIEWS,
                        "--shot-frames", FRAMES, "--truth-spheres", ",".join(map(str, ball)))
                    run("sync", take)
                for method in options.methods:
                    folder = take.parent / f"{take.name} {method}{' exact' if scene in SECONDS else ''}"
                    shutil.rmtree(folder, ignore_errors=True)
                    render(take, ball, method, frames, folder)
                    errors = []
                    for view, frame in enumerate(frames):
                        truth = np.concatenate([linear(channels(take / f"truth/view{view:03}.png", "RGB", SIZE)),
                                                channels(take / f"truth/view{view:03}.sphere.exr", "Z", SIZE)], -1)
                        file = folder / f"a.{frame:04}.exr"
                        ours = np.concatenate([channels(file, "RGB", SIZE), ball_coverage(file)[..., None]], -1)
                        errors.append(compare(truth, ours))
                    mean = {key: np.mean([error[key] for error in errors]) for key in errors[0]}
                    print(f"| {scene} | {name} | {folder.name[len(take.name) + 1:]} | {-10 * math.log10(mean['square']):.2f} | {mean['alpha']:.4f} | "
                          f"{mean['gradient']:.4f} | {mean['specks']:.1f} | {max(error['specks'] for error in errors)} |", flush=True)


if __name__ == "__main__":
    main()
