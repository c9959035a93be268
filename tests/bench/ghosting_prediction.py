#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Compares the error that thesis eq. 2.1 predicts with measured PSNR.

Simulates faultless arrays of 8 x 8 cameras of 320 x 240 pixels with four spacings at three distances from
three scenes, and renders their truth views by focal_plane on the best focal plane. For each scene it fits
  MSE = resampling + ghosting * g,  g = e^2 / sqrt(1 + (e / detail)^2),
where e is the ghosting in pixels. Prints a table and the residuals, and draws the chart.

usage: RAYSTAGE_BIN_DIR=build/release/bin ghosting_prediction.py [--chart FILE.svg]
"""

import argparse
import json
import math
import os
import pathlib
import subprocess
import tempfile

SCENES = ("still", "chart", "blue_screen")
DISTANCES_M = (0, 1, 2)  # of the array behind its usual place
SPACINGS_MM = (15, 30, 60, 120)
FOCAL_LENGTH_PX = 320 / (2 * math.tan(math.radians(31)))
DETAIL_PX = 4
COLOURS = {"still": "#0f7f78", "chart": "#a86a00", "blue_screen": "#3b5fa8"}


def run(*arguments):
    program = pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"]) / "raystage"
    return subprocess.run([program, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


def measure(scene, distance, spacing):
    """Returns the ghosting in pixels and the PSNR of focal_plane and depth in dB."""
    with tempfile.TemporaryDirectory() as folder:
        take = pathlib.Path(folder) / "take"
        run("simulate", scene, "-q", "-o", take, "--spacing-mm", spacing, "--position", f"0,0,{distance}",
            "--seconds", 0.7, "--noise", 0, "--lens-deviation", 0, "--mounting-mm", 0, "--mounting-deg", 0,
            "--k1", 0, "--k2", 0, "--truth-views", 6)
        run("sync", take, "--stamps", "exact")
        near, far = json.loads((take / "take.json").read_text())["depth_range_m"]
        psnr = {}
        for method in ("focal_plane", "depth"):
            result = pathlib.Path(folder) / f"{method}.json"
            run("evaluate", take, take / "views.json", "-q", "--method", method, "--json", result)
            psnr[method] = json.loads(result.read_text())["mean"]["psnr_db"]
        ghosting = FOCAL_LENGTH_PX * spacing / 1000 * (1 / near - 1 / far) / 2
        return ghosting, psnr["focal_plane"], psnr["depth"]


def growth(ghosting):
    return ghosting**2 / math.sqrt(1 + (ghosting / DETAIL_PX) ** 2)


def predicted(model, ghosting):
    return -10 * math.log10(model[0] + model[1] * growth(ghosting))


def residuals(model, points):
    return [predicted(model, ghosting) - psnr for ghosting, psnr, _ in points]


def rms(values):
    return math.sqrt(sum(value**2 for value in values) / len(values))


def fit(points):
    """Returns resampling and ghosting with the least RMS in dB, by search on finer and finer grids."""
    best, centre, width = None, (1e-3, 3e-4), 100.0
    for _ in range(12):
        steps = [width ** (i / 10) for i in range(-10, 11)]
        models = [(centre[0] * a, centre[1] * b) for a in steps for b in steps]
        best = min(models, key=lambda model: rms(residuals(model, points)))
        centre, width = best, width**0.5
    return best


def chart_of(measured, models):
    width, height, left, bottom = 760, 420, 60, 50
    most = max(point[0] for points in measured.values() for point in points) * 1.1
    low, high = 16, 1 + max(point[1] for points in measured.values() for point in points)

    def place(ghosting, psnr):
        return (left + (width - left - 20) * math.sqrt(ghosting / most),
                20 + (height - bottom - 20) * (high - psnr) / (high - low))

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">'
             f'<rect width="{width}" height="{height}" fill="#ffffff"/>']
    for psnr in range(20, int(high) + 1, 5):
        _, y = place(0, psnr)
        parts.append(f'<line x1="{left}" x2="{width - 20}" y1="{y:.1f}" y2="{y:.1f}" stroke="#dddddd"/>'
                     f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{psnr}</text>')
    for ghosting in (0.25, 0.5, 1, 2, 4, 8):
        if ghosting > most:
            continue
        x, _ = place(ghosting, low)
        parts.append(f'<text x="{x:.1f}" y="{height - bottom + 18}" text-anchor="middle">{ghosting:g}</text>')
    for number, (scene, points) in enumerate(measured.items()):
        colour = COLOURS[scene]
        line = " ".join("{:.1f},{:.1f}".format(*place(most * i / 200, predicted(models[scene], most * i / 200)))
                        for i in range(1, 201))
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        for ghosting, psnr, _ in points:
            x, y = place(ghosting, psnr)
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>')
        parts.append(f'<text x="{width - 140}" y="{40 + 20 * number}" fill="{colour}">{scene}</text>')
    parts.append(f'<text x="{width / 2}" y="{height - 8}" text-anchor="middle">ghosting on the best focal plane, pixels '
                 '(thesis eq. 2.1)</text>'
                 f'<text x="16" y="{height / 2}" transform="rotate(-90 16 {height / 2})" text-anchor="middle">PSNR of '
                 'focal_plane, dB</text></svg>')
    return "\n".join(parts) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--chart", type=pathlib.Path, help="draw measured points and fitted lines")
    options = parser.parse_args()
    measured, models = {}, {}
    print("| scene | distance, m | spacing, mm | ghosting, px | focal_plane, dB | depth, dB |")
    print("| --- | --: | --: | --: | --: | --: |")
    for scene in SCENES:
        measured[scene] = []
        for distance in DISTANCES_M:
            for spacing in SPACINGS_MM:
                point = measure(scene, distance, spacing)
                measured[scene].append(point)
                print(f"| {scene} | {distance} | {spacing} | {point[0]:.2f} | {point[1]:.2f} | {point[2]:.2f} |",
                      flush=True)
        models[scene] = fit(measured[scene])
    for scene, model in models.items():
        off = residuals(model, measured[scene])
        print(f"{scene}: MSE = {model[0]:.3g} + {model[1]:.3g} g; residual {rms(off):.2f} dB RMS, "
              f"{max(map(abs, off)):.2f} dB at most")
    if options.chart:
        options.chart.write_text(chart_of(measured, models))


if __name__ == "__main__":
    main()
