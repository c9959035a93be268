#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Measures bytes a frame against the quality of rendered views: JPEG, JPEG XL without loss, HEVC and AV1.

For each set of pictures, makes a take of the frames as recorded, packs it in all ways, and renders a few views with truth by `depth` from
each. Prints a table: bytes a frame as stored, times smaller than the recording, bits a pixel, PSNR of the views, loss against the views
from the recording, PSNR of the frames, milliseconds of processor time for a view of `focal_plane` in a shot that plays the take (of all
processes, also those that decode: in the first row JPEG, in others whole groups), and milliseconds for encoding a frame in a thread.
References: the thesis states 118:1 for vector quantisation with LZW of a light field (Levoy and Hanrahan), and 22:1 for its own JPEG, both
against RGB of 24 bits a pixel; the column "of RGB" compares.

Sets: simulated (the stage with sensor noise 0.02 and noise-free truth, JPEG also of lower qualities), shop, stanford_chess9x9, stage and
four_webcams of DATA (default: $RAYSTAGE_DATA or ../shared/data); missing ones are skipped. Four webcams around a person do not predict a
fifth (9 dB), nor do depths agree (14 dB): their views are those of `focal_plane`, 0.1 m to the right of one, and the truth is what the
take as recorded shows there.

usage: RAYSTAGE_BIN_DIR=build/check/bin rate_distortion.py [--sets SET...] [--data DATA] [--chart FILE.svg] [--work FOLDER]
--work: a folder for the takes, in which results of an earlier run are used again.
"""

import argparse
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import pack

SIMULATION = ("--rows", 5, "--columns", 5, "--width", 480, "--height", 360, "--seconds", 0.8, "--noise", 0.02,
              "--startup-loss-seconds", 0, "--drop", 0.01, "--truth-views", 4)
COLOURS = {"JPEG": "#666666", "JPEG XL": "#000000", "HEVC": "#c0392b", "AV1": "#2471a3"}
WEBCAM_DEPTH_M = 2  # the take states no depth range
# Of each set: method and options of `evaluate`, which choose up to four views, and (codec, references, rate factors).
SETS = {
    "simulated": (("depth",), (("hevc", "time", (23, 24, 32)), ("av1", "time", (32, 44, 56)), ("hevc", "cameras", (32,)), ("av1", "cameras", (44,)))),
    "shop": (("depth",), (("hevc", "none", (24,)), ("av1", "none", (32,)), ("hevc", "cameras", (24, 32)), ("av1", "cameras", (32, 44)))),
    "stanford_chess9x9": (("depth", "--view-step", 14),
                          (("hevc", "none", (24,)), ("av1", "none", (32,)), ("hevc", "cameras", (24, 32)), ("av1", "cameras", (32, 44)))),
    "stage": (("depth", "--view-step", 7), (("hevc", "time", (24,)), ("av1", "time", (32, 44)), ("hevc", "cameras", (24,)), ("av1", "cameras", (32,)))),
    "four_webcams": (("focal_plane", "--focal-depth", WEBCAM_DEPTH_M),
                     (("hevc", "time", (24,)), ("av1", "time", (32, 44)), ("av1", "cameras", (32,)))),
}


def run(*arguments):
    program = pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"]) / "raystage"
    return subprocess.run([program, *map(str, arguments)], check=True, stdout=subprocess.PIPE, text=True,
                          stdin=subprocess.DEVNULL).stdout


def simulate(take, quality):
    if not take.exists():
        run("simulate", "stage", "-o", take, "-q", "--quality", quality, *SIMULATION)
        run("sync", take, "-q")


def make_take(name, data, work):
    """Returns the take of a set as recorded, and its views document (None: views of a camera that is left out)."""
    take = work / "recorded"
    if name == "simulated":
        simulate(take, 95)
        return take, take / "views.json"
    if not take.exists():
        imported = work / "imported" if name == "stage" else take
        run("import", data / name / "import.json", "-o", imported, "--restart-markers", "-q")
        if name == "stage":  # free-running cameras: every frame is moved to the ticks of the truth
            run("sync", imported, "-q", "-o", take, "--fps", 15, "--tick-at", 0.233333333, "--retime", "flow")
        elif name == "four_webcams":
            run("sync", take, "-q")
    return take, views_as_recorded(take, work) if name == "four_webcams" else data / name / "views.json"


def views_as_recorded(take, work):
    """Returns views near a camera of four_webcams, whose truth is what the take shows there as recorded."""
    file = work / "views.json"
    if file.exists():
        return file
    camera = next(camera for camera in json.loads((take / "rig.json").read_text())["cameras"] if camera["id"] == "cam_1")
    pose = [[*row[:3], row[3] + 0.1 * row[0]] for row in camera["world_from_camera"][:3]] + [[0, 0, 0, 1]]
    size = f"{camera['width']}x{camera['height']}"
    probed = subprocess.run(["ffprobe", "-v", "error", "-show_packets", "-of", "json", take / "archive/cam_1.mkv"], check=True,
                            stdout=subprocess.PIPE, stdin=subprocess.DEVNULL).stdout
    views = [{"id": f"view{i}", "file": f"view{i}.png", "time_ns": packet["pts"], "width": camera["width"], "height": camera["height"],
              "intrinsics": {name: camera["intrinsics"][name] for name in ("fx", "fy", "cx", "cy")},
              "world_from_camera": pose}
             for i, packet in enumerate(json.loads(probed)["packets"][::19])]
    for view in views:  # any picture, until the views are rendered
        subprocess.run(["ffmpeg", "-v", "error", "-nostdin", "-y", "-f", "lavfi", "-i", f"color=gray:size={size}", "-frames:v", "1",
                        work / view["file"]], check=True)
    document = json.dumps({"schema": "raystage/views/1", "color_space": "srgb_texture", "views": views})
    (work / "empty_views.json").write_text(document)
    run("evaluate", take, work / "empty_views.json", "--method", *SETS["four_webcams"][0], "--no-pixel-counts", "-q", "--out",
        work / "rendered")
    for view in views:
        (work / "rendered" / view["file"]).replace(work / view["file"])
    file.write_text(document)
    return file


def frame_bytes(take):
    """Returns the stored bytes of all frames, their number, and the pixels of one."""
    cameras = json.loads(run("info", take, "--json"))["cameras"]
    return (sum((take / "archive" / (camera["id"] + ".mkv")).stat().st_size for camera in cameras),
            sum(camera["frames"] for camera in cameras), cameras[0]["width"] * cameras[0]["height"])


def psnr_of_views(take, views, chosen):
    result = take.parent / f"{take.name}.{chosen[0]}.json"
    if not result.exists():
        run("evaluate", take, views, "--method", *chosen, "--no-pixel-counts", "-q", "--json", result)
    return json.loads(result.read_text())["mean"]["psnr_db"] or math.inf  # null: no error


def milliseconds_of_a_view(take):
    result = take.parent / f"{take.name}.milliseconds"
    if not result.exists():
        shot = pack.shot_of(take.resolve(), "focal_plane")
        if "depth_range_m" not in json.loads((take / "take.json").read_text()):
            shot["layers"][0]["focal_plane"] = {"depth_m": WEBCAM_DEPTH_M}
        file = take.parent / "shot.json"
        file.write_text(json.dumps(shot))
        seconds = min(pack.measured("render", file, "-o", take.parent / "frames/f.####.exr", "--progress", "none", "--existing",
                                    "overwrite", "--threads", 1)[2] for _ in range(3))
        result.write_text(f"{1000 * seconds / shot['last_frame']:.1f}")
    return result.read_text()


class Table:
    """The rows of one set; `packed` is what `pack --json` said, or None."""

    def __init__(self, name, views, chosen):
        self.name, self.views, self.chosen, self.points = name, views, chosen, []

    def measure(self, codec, setting, take, packed=None):
        size, frames, pixels = frame_bytes(take)
        psnr = psnr_of_views(take, self.views, self.chosen)
        self.points.append({"set": self.name, "codec": codec, "bytes": size / frames, "pixels": pixels, "psnr": psnr,
                            "is_across": ", cameras" in setting})
        first = self.points[0]
        own = ("", "") if packed is None else (f"{packed['psnr_db']:.1f}", f"{1000 * packed['encode_thread_seconds'] / frames:.0f}")
        loss = "" if len(self.points) == 1 or math.isinf(first["psnr"]) else f"{first['psnr'] - psnr:.2f}"
        print(f"| {self.name} | {codec}{setting} | {size / frames:.0f} | {first['bytes'] / (size / frames):.1f} | "
              f"{3 * pixels * frames / size:.1f} | {8 * size / frames / pixels:.3f} | {psnr:.2f} | {loss} | {own[0]} | {milliseconds_of_a_view(take)} | "
              f"{own[1]} |", flush=True)


def measure_set(name, data, work):
    work.mkdir(parents=True, exist_ok=True)
    chosen, settings = SETS[name]
    take, views = make_take(name, data, work)
    table = Table(name, views, chosen)
    table.measure("JPEG", ", as recorded", take)
    for quality in (50,) if name == "simulated" else ():
        simulate(work / f"jpeg{quality}", quality)
        table.measure("JPEG", f", quality {quality}", work / f"jpeg{quality}")
    if not (work / "packed").exists():
        run("pack", take, "-o", work / "packed", "-q")
    table.measure("JPEG XL", ", without loss", work / "packed")
    for codec, references, factors in settings:
        for crf in factors:
            packed = work / f"{codec}_{references}_{crf}"
            report = work / (packed.name + ".json")
            if not packed.exists():
                report.write_text(run("pack", take, "-o", packed, "-q", "--json", "--temporal", codec, "--references", references,
                                      "--crf", crf))
            table.measure(codec.upper(), f", {references}, rate factor {crf}", packed, json.loads(report.read_text()))
    return table.points


PANEL = (380, 250)  # width and height of a set's chart


def panel_of(name, points, left, top):
    """Returns a set's chart: bits a pixel (logarithmic) against PSNR of views, with the thesis' ratios."""
    points = [point for point in points if math.isfinite(point["psnr"])]
    width, height = PANEL
    bits = [8 * point["bytes"] / point["pixels"] for point in points]
    ratios = {"118:1": 24 / 118, "22:1": 24 / 22}
    low_x, high_x = math.log10(min(*bits, *ratios.values()) / 1.3), math.log10(max(*bits, *ratios.values()) * 1.3)
    values = [point["psnr"] for point in points]
    low, high = min(values) - 0.3, max(values) + 0.3

    def place(bit, psnr):
        return (left + 45 + (width - 65) * (math.log10(bit) - low_x) / (high_x - low_x), top + 30 + (height - 80) * (high - psnr) / (high - low))

    right, bottom = place(10**high_x, low)
    parts = [f'<text x="{left + 45}" y="{top + 18}" font-weight="bold">{name}</text>',
             f'<rect x="{left + 45}" y="{top + 30}" width="{right - left - 45:.1f}" height="{bottom - top - 30:.1f}" fill="none" stroke="#bbbbbb"/>']
    step = 0.5 if high - low < 3 else 1 if high - low < 6 else 2
    for number in range(math.ceil(low / step), math.floor(high / step) + 1):
        y = place(1, number * step)[1]
        parts.append(f'<line x1="{left + 45}" x2="{right:.1f}" y1="{y:.1f}" y2="{y:.1f}" stroke="#e4e4e4"/>'
                     f'<text x="{left + 41}" y="{y + 4:.1f}" text-anchor="end">{number * step:g}</text>')
    for bit in (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10):
        if low_x <= math.log10(bit) <= high_x:
            parts.append(f'<text x="{place(bit, low)[0]:.1f}" y="{bottom + 15:.1f}" text-anchor="middle">{bit:g}</text>')
    for label, bit in ratios.items():
        x = place(bit, low)[0]
        parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{top + 30}" y2="{bottom:.1f}" stroke="#888888" stroke-dasharray="4 3"/>'
                     f'<text x="{x + 3:.1f}" y="{bottom - 4:.1f}" fill="#888888">{label}</text>')
    for bit, point in zip(bits, points):
        x, y = place(bit, point["psnr"])
        colour = COLOURS[point["codec"]]
        fill = "#ffffff" if point["is_across"] else colour
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{fill}" stroke="{colour}" stroke-width="1.5"/>')
    return parts


def chart_of(sets):
    columns = 2
    width, height = columns * PANEL[0] + 10, -(-(len(sets) + 1) // columns) * PANEL[1] + 10
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">'
             f'<rect width="{width}" height="{height}" fill="#ffffff"/>']
    for number, (name, points) in enumerate(sets.items()):
        parts += panel_of(name, points, number % columns * PANEL[0], number // columns * PANEL[1])
    left, top = len(sets) % columns * PANEL[0] + 60, len(sets) // columns * PANEL[1] + 50
    for number, (codec, colour) in enumerate(COLOURS.items()):
        parts.append(f'<circle cx="{left}" cy="{top + 22 * number - 4}" r="4" fill="{colour}"/><text x="{left + 12}" y="{top + 22 * number}">{codec}</text>')
    for number, line in enumerate(("Hollow: references across cameras", "Horizontal: bits a pixel; vertical: PSNR of views, dB",
                                   "Dashed: ratios of the thesis to RGB of 24 bits a pixel")):
        parts.append(f'<text x="{left - 6}" y="{top + 22 * (len(COLOURS) + number)}">{line}</text>')
    return "\n".join(parts) + "\n</svg>\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="*", choices=SETS, default=list(SETS))
    parser.add_argument("--data", type=pathlib.Path, default=pathlib.Path(os.environ.get("RAYSTAGE_DATA", "../shared/data")))
    parser.add_argument("--chart", type=pathlib.Path)
    parser.add_argument("--work", type=pathlib.Path)
    options = parser.parse_args()
    pack.become_parent_of_orphans()
    with tempfile.TemporaryDirectory() as folder:
        work = options.work or pathlib.Path(folder)
        measured = {}
        print("| set | frames | bytes a frame | times smaller | of RGB | bits a pixel | views, dB | loss, dB | frames, dB | ms a view | "
              "encoding, ms a frame |")
        print("| --- | --- | --: | --: | --: | --: | --: | --: | --: | --: | --: |")
        for name in options.sets:
            if name != "simulated" and not (options.data / name / "import.json").exists():
                print(f"{options.data / name} has no import.json: skipped", file=sys.stderr)
                continue
            measured[name] = measure_set(name, options.data, work / name)
        if options.chart:
            options.chart.write_text(chart_of(measured))


if __name__ == "__main__":
    main()
