#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Measures bytes a frame against the quality of rendered views: JPEG, JPEG XL without loss, HEVC and AV1.

Simulates takes with sensor noise at some JPEG qualities, packs that of the best in all ways, and renders the noise-free truth views
by `depth` from each. The loss of a codec is in dB of PSNR below the views from the JPEG of the best quality. Prints a table: bytes a
frame, times smaller than that JPEG, bits a pixel, PSNR of the views, loss, and the wall time of decoding a view's frames with empty
caches. References: the thesis states 118:1 for vector quantisation with LZW of a light field (Levoy and Hanrahan), and 22:1 for its
own JPEG, both against RGB of 24 bits a pixel; the column "of RGB" compares.

usage: RAYSTAGE_BIN_DIR=build/check/bin rate_distortion.py [--take FOLDER --views FILE] [--chart FILE.svg] [--work FOLDER]
       [--av1 CRF...] [--hevc CRF...] [--group N]
--take: a take and its views document in place of the simulation; without JPEG of lower qualities.
"""

import argparse
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

QUALITIES = (95, 75, 50, 20)
SIMULATION = ("--rows", 5, "--columns", 5, "--width", 480, "--height", 360, "--seconds", 0.8, "--noise", 0.02,
              "--startup-loss-seconds", 0, "--drop", 0.01, "--truth-views", 4)
COLOURS = {"JPEG": "#666666", "JPEG XL": "#000000", "HEVC": "#c0392b", "AV1": "#2471a3"}


def run(*arguments):
    program = pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"]) / "raystage"
    return subprocess.run([program, *map(str, arguments)], check=True, stdout=subprocess.PIPE, text=True,
                          stdin=subprocess.DEVNULL).stdout


def simulate(take, quality):
    if not take.exists():
        run("simulate", "stage", "-o", take, "-q", "--quality", quality, *SIMULATION)
        run("sync", take, "-q")


def frame_bytes(take):
    """Returns the stored bytes of all frames, their number, and the pixels of one."""
    cameras = json.loads(run("info", take, "--json"))["cameras"]
    return (sum((take / "archive" / (camera["id"] + ".mkv")).stat().st_size for camera in cameras),
            sum(camera["frames"] for camera in cameras), cameras[0]["width"] * cameras[0]["height"])


def evaluate(take, views, work):
    run("evaluate", take, views, "--method", "depth", "--no-pixel-counts", "-q", "--json", work / "evaluation.json")
    mean = json.loads((work / "evaluation.json").read_text())["mean"]
    return mean["psnr_db"], mean["decode_ms"]


def measure(codec, setting, take, views, work, points):
    size, frames, pixels = frame_bytes(take)
    psnr, decode_ms = evaluate(take, views, work)
    points.append({"codec": codec, "setting": setting, "bytes": size / frames, "pixels": pixels, "psnr": psnr, "decode_ms": decode_ms})
    first = points[0]
    print(f"| {codec} | {setting} | {size / frames:.0f} | {first['bytes'] / (size / frames):.1f} | {3 * pixels * frames / size:.1f} | "
          f"{8 * size / frames / pixels:.3f} | {psnr:.2f} | {first['psnr'] - psnr:.2f} | {decode_ms:.0f} |", flush=True)


def chart_of(points, title):
    width, height, left, bottom = 760, 420, 60, 50

    low_x, high_x = (math.log10(f(point["bytes"] for point in points)) for f in (min, max))
    low, high = min(point["psnr"] for point in points) - 0.5, max(point["psnr"] for point in points) + 0.5

    def place(point):
        return (left + 15 + (width - left - 50) * (math.log10(point["bytes"]) - low_x) / max(high_x - low_x, 1e-9),
                20 + (height - bottom - 20) * (high - point["psnr"]) / (high - low))

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">'
             f'<rect width="{width}" height="{height}" fill="#ffffff"/>']
    for psnr in range(math.ceil(low), int(high) + 1):
        y = place({"bytes": 1, "psnr": psnr})[1]
        parts.append(f'<line x1="{left}" x2="{width - 20}" y1="{y:.1f}" y2="{y:.1f}" stroke="#dddddd"/>'
                     f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{psnr}</text>')
    for size in (500, 1000, 2000, 5000, 10000, 20000, 50000, 100000, 200000, 500000):
        if low_x <= math.log10(size) <= high_x:
            x = place({"bytes": size, "psnr": low})[0]
            parts.append(f'<text x="{x:.1f}" y="{height - bottom + 18}" text-anchor="middle">{size:,}</text>')
    for number, (codec, colour) in enumerate(COLOURS.items()):
        own = sorted((point for point in points if point["codec"] == codec), key=lambda point: point["bytes"])
        line = " ".join("{:.1f},{:.1f}".format(*place(point)) for point in own)
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        for point in own:
            x, y = place(point)
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>')
        parts.append(f'<text x="{width - 120}" y="{height - bottom - 80 + 20 * number}" fill="{colour}">{codec}</text>')
    parts.append(f'<text x="{width / 2}" y="{height - 8}" text-anchor="middle">bytes a frame, {title}</text>'
                 f'<text x="16" y="{height / 2}" transform="rotate(-90 16 {height / 2})" text-anchor="middle">PSNR of views, dB</text></svg>')
    return "\n".join(parts) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--take", type=pathlib.Path)
    parser.add_argument("--views", type=pathlib.Path)
    parser.add_argument("--chart", type=pathlib.Path)
    parser.add_argument("--work", type=pathlib.Path)
    parser.add_argument("--av1", type=int, nargs="*", default=(24, 32, 40, 48, 56))
    parser.add_argument("--hevc", type=int, nargs="*", default=(20, 24, 28, 32, 36))
    parser.add_argument("--group", type=int, default=12)
    options = parser.parse_args()
    if (options.take is None) != (options.views is None):
        sys.exit("rate_distortion.py: give both a take and its views document, or neither")
    with tempfile.TemporaryDirectory() as folder:
        work = options.work or pathlib.Path(folder)
        work.mkdir(exist_ok=True)
        points = []
        print("| codec | setting | bytes a frame | times smaller | of RGB | bits a pixel | views, dB | loss, dB | decoding, ms a view |")
        print("| --- | --- | --: | --: | --: | --: | --: | --: | --: |")
        take, views = options.take, options.views
        if take is None:
            take = work / f"jpeg{QUALITIES[0]}"
            simulate(take, QUALITIES[0])
            views = take / "views.json"
        measure("JPEG", f"quality {QUALITIES[0]}" if options.take is None else "as recorded", take, views, work, points)
        for quality in QUALITIES[1:] if options.take is None else ():
            simulate(work / f"jpeg{quality}", quality)
            measure("JPEG", f"quality {quality}", work / f"jpeg{quality}", views, work, points)
        if not (work / "packed").exists():
            run("pack", take, "-o", work / "packed", "-q")
        measure("JPEG XL", "without loss", work / "packed", views, work, points)
        for codec, factors in (("HEVC", options.hevc), ("AV1", options.av1)):
            for crf in factors:
                packed = work / f"{codec.lower()}{crf}"
                if not packed.exists():
                    run("pack", take, "-o", packed, "-q", "--temporal", codec.lower(), "--crf", crf, "--group", options.group)
                measure(codec, f"rate factor {crf}", packed, views, work, points)
        if options.chart:
            options.chart.write_text(chart_of(points, take.name if options.take else "simulated stage, sensor noise 0.02"))


if __name__ == "__main__":
    main()
