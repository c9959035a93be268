#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The reader in integrations/reader, which follows docs/formats, agrees with our commands and with other programs."""
import ast
import collections
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

BIN = pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"])
READER = pathlib.Path(__file__).resolve().parents[2] / "integrations/reader/read_take.py"
WIDTH, HEIGHT, FOV_DEG, DEPTH_M = 240, 180, 60, 2
POSITION, ORIENTATION = (0.05, 0.03, 0.12), (0.9998, 0.01, 0.015, 0.0)  # sees past the array's border


def output_of(*command: object) -> bytes:
    run = subprocess.run([str(part) for part in command], stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if run.returncode != 0:
        raise AssertionError(f"{command}: exit code {run.returncode}\n{run.stderr.decode()}")
    return run.stdout


def raystage(*arguments: object) -> bytes:
    return output_of(BIN / "raystage", *arguments)


def read(take: pathlib.Path, *options: object) -> tuple[dict, pathlib.Path]:
    """Returns what the reader lists, and the folder of its files."""
    folder = pathlib.Path(tempfile.mkdtemp(dir=take.parent))
    output_of(sys.executable, READER, take, "-o", folder, *options)
    return json.loads((folder / "take.json").read_text()), folder


def jpegs(folder: pathlib.Path, camera: dict) -> list[bytes]:
    return [(folder / f"{camera['id']}.{i}.jpg").read_bytes() for i in range(len(camera["frames"]))]


def pixels_of(picture: pathlib.Path, pixel_format: str, kind: str) -> np.ndarray:
    data = output_of("ffmpeg", "-nostdin", "-v", "error", "-i", picture, "-f", "rawvideo", "-pix_fmt", pixel_format, "-")
    return np.frombuffer(data, kind)


def light_of(picture: pathlib.Path) -> tuple[np.ndarray, np.ndarray]:
    """Returns the linear light R, G, B and A of an EXR file."""
    green, blue, red, alpha = pixels_of(picture, "gbrapf32le", "<f4").reshape(4, HEIGHT, WIDTH)
    return np.dstack([red, green, blue]) / np.maximum(alpha, 1e-6)[..., None], alpha


def codes_of(light: np.ndarray) -> np.ndarray:
    shown = np.clip(light, 0, 1)
    return np.where(shown <= 0.0031308, shown * 12.92, 1.055 * shown ** (1 / 2.4) - 0.055)


def rotation(quaternion: tuple) -> np.ndarray:
    w, x, y, z = np.array(quaternion) / np.linalg.norm(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def flip_bit(file: pathlib.Path, at: int) -> None:
    data = bytearray(file.read_bytes())
    data[at] ^= 1
    file.write_bytes(data)


class Reader(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory(prefix="raystage-reader-")
        cls.root = pathlib.Path(cls.folder.name)
        cls.take = cls.simulate("take", "--photometric", "0.05")
        cls.listed, cls.files = read(cls.take)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()

    @classmethod
    def simulate(cls, name: str, *options: object) -> pathlib.Path:
        take = cls.root / name
        raystage("simulate", "stage", "-q", "-o", take, "--rows", 4, "--columns", 4, "--width", 160, "--height", 120, "--seconds", 1.5,
                 "--fps", 10, "--startup-loss-seconds", 0.2, "--drop", 0.15, "--truth-views", 0, *options)
        raystage("sync", "-q", take)
        return take

    def copy(self, name: str) -> pathlib.Path:
        return pathlib.Path(shutil.copytree(self.take, self.root / name))

    def test_it_is_short_and_uses_no_code_of_ours(self) -> None:
        text = READER.read_text()
        self.assertLess(len(text.splitlines()), 300)
        self.assertLessEqual(max(map(len, text.splitlines())), 140)
        imported = {name.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import) for name in node.names}
        self.assertFalse([node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)])
        self.assertEqual({name for name in imported if name not in sys.stdlib_module_names}, {"numpy"})
        self.assertFalse(imported & {"importlib", "ctypes", "runpy"})
        strings = [node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
        self.assertFalse([string for string in strings if string == "raystage" or string.startswith("raystage ")], "runs no command of ours")

    def test_frames_times_and_gaps_are_the_true_ones(self) -> None:
        truth = json.loads((self.take / "truth.json").read_text())["cameras"]
        self.assertEqual([camera["id"] for camera in self.listed["cameras"]], [camera["id"] for camera in truth])
        reasons = set()
        for camera, true in zip(self.listed["cameras"], truth):
            expected = list(zip(true["stamped_time_ns"], true["status"]))
            self.assertEqual([frame["time_ns"] for frame in camera["frames"]], [time for time, status in expected if status == "stored"])
            gaps = [(gap["time_ns"], gap["reason"]) for gap in camera["gaps"]]
            self.assertEqual(gaps, [(time, status) for time, status in expected if status != "stored"])
            reasons |= {reason for _, reason in gaps}
            self.assertTrue(all(frame["intact"] and frame["is_block"] for frame in camera["frames"]))
        self.assertEqual(reasons, {"lost at start-up", "dropped by the source"})

    def test_info_and_verify_count_the_same(self) -> None:
        report = self.root / "verify.json"
        raystage("verify", self.take, "--json", report)
        verified = json.loads(report.read_text())["cameras"]
        info = json.loads(raystage("info", self.take, "--json"))
        for camera, known, whole in zip(self.listed["cameras"], info["cameras"], verified):
            self.assertEqual((camera["id"], len(camera["frames"])), (known["id"], known["frames"]))
            self.assertEqual(collections.Counter(gap["reason"] for gap in camera["gaps"]), collections.Counter(known["missing"]))
            self.assertEqual((len(camera["frames"]), True), (whole["frames"], whole["intact"]))
        timeline = self.listed["timeline"]
        self.assertEqual(len(timeline["ticks_ns"]), info["timeline"]["ticks"])
        self.assertAlmostEqual(timeline["rate_hz"], info["timeline"]["fps"], places=9)
        absent = sum(row.count(-1) for row in timeline["frames"])
        self.assertEqual(absent, info["timeline"]["absent_total"])
        self.assertGreater(absent, 0)

    def test_other_programs_find_the_same_bytes_and_times(self) -> None:
        for camera in self.listed["cameras"]:
            archive = self.take / f"archive/{camera['id']}.mkv"
            output_of("mkvextract", archive, "tracks", "--raw", f"0:{self.root / 'raw'}")
            stored = jpegs(self.files, camera)
            self.assertEqual(b"".join(stored), (self.root / "raw").read_bytes())
            self.assertEqual([len(jpeg) for jpeg in stored], [frame["size"] for frame in camera["frames"]])
            packets = json.loads(output_of("ffprobe", "-v", "error", "-show_packets", "-of", "json", archive))["packets"]
            self.assertEqual([(packet["pts"], int(packet["size"])) for packet in packets],
                             [(frame["time_ns"], frame["size"]) for frame in camera["frames"]])

    def test_a_packed_take_gives_the_same_frames(self) -> None:
        packed = self.root / "packed"
        raystage("pack", "-q", self.take, "-o", packed)
        listed, files = read(packed)
        self.assertEqual({camera["codec"] for camera in listed["cameras"]}, {"V_JPEGXL"})
        for before, camera in zip(self.listed["cameras"], listed["cameras"]):
            self.assertEqual(jpegs(files, camera), jpegs(self.files, before))
            self.assertEqual([frame["time_ns"] for frame in camera["frames"]], [frame["time_ns"] for frame in before["frames"]])
            self.assertEqual(camera["gaps"], before["gaps"])
            self.assertTrue(all(frame["intact"] for frame in camera["frames"]))

    def test_blocks_of_video_are_as_stored(self) -> None:
        for codec, references, kind in (("hevc", "time", "hevc"), ("av1", "time", "obu"), ("hevc", "cameras", "hevc")):
            video = self.root / f"{codec}_{references}"
            raystage("pack", "-q", self.take, "-o", video, "--temporal", codec, "--references", references)
            listed, files = read(video)
            for before, camera in zip(self.listed["cameras"], listed["cameras"]):
                self.assertEqual([frame["time_ns"] for frame in camera["frames"]], [frame["time_ns"] for frame in before["frames"]])
                self.assertEqual(camera["gaps"], before["gaps"])
                self.assertTrue(all(frame["intact"] and frame["is_block"] for frame in camera["frames"]))
                archive = video / f"archive/{camera['id']}.mkv"
                output_of("mkvextract", archive, "tracks", "--raw", f"0:{self.root / 'raw'}")
                stored = [(files / f"{camera['id']}.{i}.{kind}").read_bytes() for i in range(len(camera["frames"]))]
                self.assertEqual(b"".join(stored), (self.root / "raw").read_bytes())

    def test_the_first_journals_are_read(self) -> None:
        golden = pathlib.Path(__file__).resolve().parents[1] / "golden/0.1-2026-11-21/take"
        take = pathlib.Path(shutil.copytree(golden, self.root / "first"))
        info = json.loads(raystage("info", take, "--json"))
        listed, _ = read(take)
        for camera, known in zip(listed["cameras"], info["cameras"]):
            self.assertEqual((camera["id"], len(camera["frames"])), (known["id"], known["frames"]))
            self.assertEqual(collections.Counter(gap["reason"] for gap in camera["gaps"]), collections.Counter(known["missing"]))
            self.assertTrue(all(frame["intact"] and frame["is_block"] for frame in camera["frames"]))

    def test_no_file_is_written_outside(self) -> None:
        for number, name in enumerate(("../escaped", str(self.root / "escaped"))):
            take = self.copy(f"hostile{number}")
            text = (take / "take.json").read_text()
            first = self.listed["cameras"][0]["id"]
            (take / "take.json").write_text(text.replace(f'"id": "{first}"', f'"id": "{name}"'))
            command = [sys.executable, READER, take, "-o", self.root / "out"]
            done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 1)
            self.assertIn("outside", done.stderr)
            self.assertFalse(list(self.root.glob("escaped*")))

    def test_damage_is_found_where_it_is(self) -> None:
        damaged = self.copy("damaged")
        rotten, lost, torn = self.listed["cameras"][:3]
        flip_bit(damaged / f"archive/{rotten['id']}.mkv", rotten["frames"][2]["offset"] + 1000)
        (damaged / f"archive/{lost['id']}.journal").unlink()
        archive = damaged / f"archive/{torn['id']}.mkv"
        archive.write_bytes(archive.read_bytes()[:torn["frames"][-1]["offset"] + 100])
        open_archive = damaged / f"archive/{self.listed['cameras'][4]['id']}.mkv"  # as while it is recorded: size unknown
        data, segment = open_archive.read_bytes(), bytes.fromhex("18538067")
        at = data.index(segment) + len(segment)
        open_archive.write_bytes(data[:at] + bytes.fromhex("01ffffffffffffff") + data[at + 8:])
        unrecorded = self.listed["cameras"][3]
        record = sum(gap["time_ns"] < unrecorded["frames"][0]["time_ns"] for gap in unrecorded["gaps"])  # of the first frame
        flip_bit(damaged / f"archive/{unrecorded['id']}.journal", 64 + 48 * record + 35)
        listed, files = read(damaged)
        found = listed["cameras"]
        self.assertEqual([frame["intact"] for frame in found[0]["frames"]], [i != 2 for i in range(len(rotten["frames"]))])
        self.assertEqual([(frame["time_ns"], frame["offset"], frame["size"]) for frame in found[1]["frames"]],
                         [(frame["time_ns"], frame["offset"], frame["size"]) for frame in lost["frames"]])
        self.assertEqual({frame["intact"] for frame in found[1]["frames"]}, {None})
        self.assertEqual(jpegs(files, found[1]), jpegs(self.files, lost))
        self.assertEqual([frame["intact"] for frame in found[2]["frames"]], [True] * (len(torn["frames"]) - 1) + [False])
        self.assertEqual([frame["intact"] for frame in found[3]["frames"]], [None] + [True] * (len(unrecorded["frames"]) - 1))
        self.assertEqual(found[3]["frames"][0]["offset"], unrecorded["frames"][0]["offset"], "found in the archive")
        self.assertEqual(found[3]["gaps"], unrecorded["gaps"])
        self.assertEqual(found[4:], self.listed["cameras"][4:])

    def compare_pictures(self, take: pathlib.Path, tick_choice=max) -> tuple[float, float]:
        """Compares the pictures of the tick at which most cameras are absent, or fewest (min). Returns the brightest light of both."""
        ticks = read(take)[0]["timeline"]
        absent = [sum(row[tick] < 0 for row in ticks["frames"]) for tick in range(len(ticks["ticks_ns"]))]
        tick = absent.index(tick_choice(absent))
        self.assertTrue(tick_choice is min or absent[tick] > 0)
        seconds = (ticks["ticks_ns"][tick] - ticks["ticks_ns"][0]) / 1e9
        shot = {"schema": "raystage/shot/3", "name": "one", "width": WIDTH, "height": HEIGHT, "fps": 10, "first_frame": 1, "last_frame": 1,
                "camera": {"keys": [{"frame": 1, "position": POSITION, "orientation": ORIENTATION, "horizontal_fov_deg": FOV_DEG}]},
                "layers": [{"take": str(take), "method": "focal_plane", "focal_plane": {"depth_m": DEPTH_M}, "start_seconds": seconds,
                            "speed": 0}], "output": {"compression": "zip", "layout": "single", "aovs": []}}
        (take.parent / "shot.json").write_text(json.dumps(shot))
        ours = take.parent / f"{take.name}.0001.exr"
        raystage("render", take.parent / "shot.json", "-q", "--existing", "overwrite", "-o", take.parent / f"{take.name}.####.exr")
        focal = WIDTH / 2 / np.tan(np.radians(FOV_DEG / 2))
        pose = np.vstack([np.column_stack([rotation(ORIENTATION), POSITION]), [0, 0, 0, 1]])
        view = {"id": "one", "width": WIDTH, "height": HEIGHT, "world_from_camera": pose.tolist(), "time_ns": ticks["ticks_ns"][tick],
                "intrinsics": {"fx": focal, "fy": focal, "cx": WIDTH / 2, "cy": HEIGHT / 2}}
        (take.parent / "views.json").write_text(json.dumps({"schema": "raystage/views/1", "color_space": "srgb_texture", "views": [view]}))
        _, files = read(take, "--views", take.parent / "views.json", "--depth-m", DEPTH_M)
        light, alpha = light_of(ours)
        found, found_alpha = light_of(files / "picture.exr")
        seen = alpha > 0.01
        self.assertGreater(np.count_nonzero(alpha == 0), 0.05 * alpha.size, "the view sees past the array")
        self.assertGreater(np.count_nonzero(seen), 0.5 * alpha.size)
        self.assertLess(np.max(np.abs(found_alpha - alpha)), 0.01, "covered alike, pixel by pixel")
        error = np.mean((codes_of(found) - codes_of(light))[seen] ** 2)
        self.assertGreater(light[seen].mean(), 0.05, "something is seen")
        psnr = -10 * np.log10(error)
        print(f"{take.name}: {psnr:.1f} dB over {np.count_nonzero(seen)} pixels", file=sys.stderr)
        self.assertGreater(psnr, 56)
        solid = alpha > 0.99
        bright = light[solid] > 0.05  # in darker tones decoders of JPEG differ
        self.assertLess(np.percentile(abs(np.log2(found[solid][bright] / light[solid][bright])), 99.9), 0.05, "not clipped alike")
        return float(light[solid].max()), float(found[solid].max())

    def test_the_picture_of_a_grid_agrees(self) -> None:
        self.compare_pictures(self.take)
        self.compare_pictures(self.take, min)

    def test_pictures_of_more_than_8_bits_agree(self) -> None:
        take = self.simulate("deep", "--hdr", "--photometric", "0.05")
        listed, files = read(take)
        self.assertEqual({camera["codec"] for camera in listed["cameras"]}, {"V_JPEGXL/PICTURE"})
        camera, archive = listed["cameras"][0], take / f"archive/{listed['cameras'][0]['id']}.mkv"
        output_of("mkvextract", archive, "tracks", "--raw", f"0:{self.root / 'raw'}")
        stored = [(files / f"{camera['id']}.{i}.jxl").read_bytes() for i in range(len(camera["frames"]))]
        self.assertEqual(b"".join(stored), (self.root / "raw").read_bytes())
        brightest, found = self.compare_pictures(take, min)
        self.assertGreater(brightest, 8, "the light of lamps above white")
        self.assertLess(abs(np.log2(found / brightest)), 0.03)

    def test_pictures_of_integers_agree(self) -> None:
        half = self.simulate("half", "--hdr")
        listed, files = read(half)
        rig, source = json.loads((half / "rig.json").read_text()), self.root / "pictures"
        source.mkdir()
        for camera, frames in zip(rig["cameras"], (camera["frames"] for camera in listed["cameras"])):
            camera["frames"] = []
            for i, frame in enumerate(frames[:8]):
                name = f"{camera['id']}.{i}"
                output_of("djxl", files / f"{name}.jxl", source / f"{name}.pfm")
                _, _, order, data = (source / f"{name}.pfm").read_bytes().split(b"\n", 3)
                values = np.frombuffer(data, "<f4" if order.startswith(b"-") else ">f4").reshape(camera["height"], camera["width"], 3)[::-1]
                codes = np.round(65535 * codes_of(values)).astype("<u2")
                subprocess.run(["ffmpeg", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb48le", "-s", f"{camera['width']}x{camera['height']}",
                                "-i", "pipe:0", source / f"{name}.png"], input=codes.tobytes(), check=True)
                camera["frames"].append({"file": f"{name}.png", "time_ns": frame["time_ns"]})
        manifest = {"schema": "raystage/import/1", "name": "integers", "epoch_utc": "2026-01-01T00:00:00Z", "nominal_fps": 10,
                    "color_space": "srgb_texture", "depth_range_m": [2, 10], "cameras": rig["cameras"]}
        (source / "import.json").write_text(json.dumps(manifest))
        take = self.root / "integers"
        raystage("import", "-q", source / "import.json", "-o", take)
        raystage("sync", "-q", take)
        pixels = json.loads((take / "take.json").read_text())["cameras"][0]["pixels"]
        self.assertEqual((pixels["samples"], pixels["bits"], pixels["transfer"]), ("integer", 16, "srgb"))
        self.compare_pictures(take, min)

    def test_light_of_a_movie_of_10_bits_is_ours(self) -> None:
        source = self.root / "movies"
        source.mkdir()
        rig = json.loads((self.take / "rig.json").read_text())
        camera = {name: value for name, value in rig["cameras"][0].items() if name != "photometric"}
        command = ["ffmpeg", "-v", "error", "-nostdin", "-f", "lavfi", "-i", f"color=white:size={camera['width']}x{camera['height']}:rate=10",
                   "-frames:v", "2", "-c:v", "ffv1", "-pix_fmt", "gbrp10le", source / "a.mkv"]
        subprocess.run(command, check=True)
        manifest = {"schema": "raystage/import/1", "name": "white", "epoch_utc": "2026-01-01T00:00:00Z", "nominal_fps": 10,
                    "color_space": "srgb_texture", "cameras": [{**camera, "movie": "a.mkv"}]}
        (source / "import.json").write_text(json.dumps(manifest))
        raystage("import", "-q", source / "import.json", "-o", self.root / "white")
        sys.path.insert(0, str(READER.parent))
        import read_take
        light = read_take.Take(self.root / "white").light(0, 0)
        self.assertLess(abs(light - 1).max(), 0.01, "white is 1020 of 1023")

    def test_the_picture_of_an_exact_grid_agrees(self) -> None:
        take = self.simulate("exact", "--mounting-mm", 0, "--seed", 5)
        self.compare_pictures(take)
        self.compare_pictures(take, min)  # every cell is a square: both diagonals are equally long

    def test_the_picture_of_an_array_without_a_grid_agrees(self) -> None:
        scattered = self.copy("scattered")
        rig = json.loads((scattered / "rig.json").read_text())
        rig["topology"] = "delaunay"
        (scattered / "rig.json").write_text(json.dumps(rig))
        self.compare_pictures(scattered)


if __name__ == "__main__":
    unittest.main()
