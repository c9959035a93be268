#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Measures takes of more than 8 bits: bytes a frame, and the time of views, against the same scene recorded as JPEG.

Simulates the stage with lamps above white twice, as half floats and as JPEG, and imports the half floats again as 16-bit integers (sRGB
curve of light divided by the brightest). Prints two tables. Bytes: frames as the takes store them, and the same pictures as EXR (half, zip;
`export images`) and as 16-bit PNG (FFmpeg). Time: a shot of one frame, and of 9 frames of the same instant from a camera that moves, in
processor seconds of all processes with one thread and the depths not stored before. The first frame decodes what it needs (and `depth` solves
depths); those after it find decoded frames in the cache. The median of the runs counts; the takes alternate.

usage: RAYSTAGE_BIN_DIR=build/check/bin deep_takes.py [--work FOLDER] [--runs N] [--width W] [--grid N]
"""

import argparse
import ctypes
import json
import os
import pathlib
import resource
import shutil
import statistics
import subprocess
import tempfile

import numpy as np

METHODS = {"focal_plane": {}, "depth": {"near": 2, "far": 9}}
FRAMES = 9


def run(*arguments, **options):
    return subprocess.run(list(map(str, arguments)), check=True, capture_output=True, **options).stdout


def raystage(*arguments):
    return run(pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"]) / "raystage", *arguments, stdin=subprocess.DEVNULL)


def processor_seconds(*arguments):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    raystage(*arguments)
    try:
        while True:  # decoders that outlive their command by a moment
            os.waitpid(-1, 0)
    except ChildProcessError:
        pass
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def integer_take(source, folder, take):
    """Imports the frames of a take of half floats as 16-bit PNG files, which remain in `folder`."""
    raystage("export", "images", source, "-o", folder / "exr", "--format", "exr", "-q")
    manifest = json.loads((folder / "exr/import.json").read_text())
    manifest["color_space"] = "srgb_texture"
    files = [frame for camera in manifest["cameras"] for frame in camera["frames"]]
    lights = []
    for frame in files:
        camera = next(camera for camera in manifest["cameras"] if frame in camera["frames"])
        planes = np.frombuffer(run("ffmpeg", "-v", "error", "-i", folder / "exr" / frame["file"], "-f", "rawvideo", "-pix_fmt", "gbrpf32le",
                                   "-"), "<f4").reshape(3, camera["height"], camera["width"])
        lights.append(np.dstack([planes[2], planes[0], planes[1]]))
    peak = max(light.max() for light in lights)
    for frame, light in zip(files, lights):
        part = np.clip(light / peak, 0, 1)
        codes = np.round(65535 * np.where(part <= 0.0031308, part * 12.92, 1.055 * part ** (1 / 2.4) - 0.055)).astype("<u2")
        frame["file"] = frame["file"].replace("/", ".").replace(".exr", ".png")
        run("ffmpeg", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb48le", "-s", f"{light.shape[1]}x{light.shape[0]}", "-i", "pipe:0",
            folder / frame["file"], input=codes.tobytes())
    (folder / "import.json").write_text(json.dumps(manifest))
    raystage("import", "-q", folder / "import.json", "-o", take)


def shot_of(take, method, frames, seconds, file):
    """Writes a shot that shows one instant from a camera that moves by a tenth of a metre over nine frames."""
    keys = [{"frame": frame, "position": [x, 0, 0], "target": [0, 0, -4], "horizontal_fov_deg": 50} for frame, x in ((1, -0.04), (FRAMES, 0.06))]
    file.write_text(json.dumps({
        "schema": "raystage/shot/3", "name": "bench", "width": 640, "height": 480, "fps": 10, "first_frame": 1, "last_frame": frames,
        "camera": {"keys": keys}, "layers": [{"take": str(take), "method": method, "options": METHODS[method], "focal_plane": {"depth_m": 4},
                                              "start_seconds": seconds, "speed": 0}]}))


def megabytes(folder, pattern):
    sizes = [file.stat().st_size for file in folder.rglob(pattern)]
    return sum(sizes) / len(sizes) / 1e6


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=pathlib.Path)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--grid", type=int, default=4)
    options = parser.parse_args()
    work = options.work or pathlib.Path(tempfile.mkdtemp(prefix="raystage-deep-"))
    work.mkdir(exist_ok=True)
    ctypes.CDLL(None, use_errno=True).prctl(36, 1, 0, 0, 0)  # PR_SET_CHILD_SUBREAPER
    takes = {"half floats": work / "half", "JPEG, quality 95, 4:4:4": work / "jpeg"}
    for name, take in takes.items():
        if take.exists():
            continue
        raystage("simulate", "stage", "-q", "-o", take, "--hdr", "--bits", 8 if "JPEG" in name else 16, "--rows", options.grid, "--columns",
                 options.grid, "--width", options.width, "--height", options.width * 3 // 4, "--fps", 10, "--seconds", 0.4,
                 "--startup-loss-seconds", 0, "--drop", 0, "--truth-views", 0)
        raystage("sync", "-q", take)
    if not (work / "integers").exists():
        shutil.rmtree(work / "pictures", ignore_errors=True)
        (work / "pictures").mkdir()
        integer_take(takes["half floats"], work / "pictures", work / "integers")

    def frame_megabytes(take):
        info = json.loads(raystage("info", "--json", take))
        return sum(file.stat().st_size for file in (take / "archive").glob("*.mkv")) / sum(c["frames"] for c in info["cameras"]) / 1e6

    exr, png = megabytes(work / "pictures/exr", "*.exr"), megabytes(work / "pictures", "*.png")
    print("| frames | MB a frame | of EXR (half, zip) | of 16-bit PNG |\n| --- | --: | --: | --: |")
    for name, size in ((("take of half floats (JPEG XL)", frame_megabytes(work / "half")), ("the same as EXR, half, zip", exr),
                        ("take of 16-bit integers (JPEG XL)", frame_megabytes(work / "integers")), ("the same as 16-bit PNG", png),
                        ("take of JPEG, quality 95, 4:4:4", frame_megabytes(work / "jpeg")))):
        print(f"| {name} | {size:.3f} | {size / exr:.2f} | {size / png:.2f} |")

    print(f"\n| method | take | first view, CPU s | each view after it, CPU s | first view against JPEG |\n| --- | --- | --: | --: | --: |")
    for method in METHODS:
        seconds = {name: {1: [], FRAMES: []} for name in takes}
        for _ in range(options.runs):
            for name, take in takes.items():
                for frames in (1, FRAMES):
                    shutil.rmtree(take / "depth", ignore_errors=True)
                    shot_of(take, method, frames, 0.1, work / "shot.json")
                    seconds[name][frames].append(processor_seconds("render", work / "shot.json", "-q", "-j", 1, "--existing", "overwrite",
                                                                   "-o", work / "rendered/f.####.exr"))
        median = {name: {n: statistics.median(times) for n, times in of.items()} for name, of in seconds.items()}
        jpeg = median["JPEG, quality 95, 4:4:4"][1]
        for name, of in median.items():
            print(f"| `{method}` | {name} | {of[1]:.2f} | {(of[FRAMES] - of[1]) / (FRAMES - 1):.3f} | {of[1] / jpeg:.2f} |")


if __name__ == "__main__":
    main()
