#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The add-on in Blender: cameras, takes and renders arrive where and when they should.

    blender_addon_test.py [TEST]

RAYSTAGE_BIN_DIR: folder of the programs (default: build/check/bin). Skipped without Blender or oiiotool.
"""
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BIN = pathlib.Path(os.environ.get("RAYSTAGE_BIN_DIR", ROOT / "build/check/bin"))
HERE = pathlib.Path(__file__).resolve().parent
ADDON = ROOT / "integrations/blender/raystage_blender.py"
FIRST, LAST = 1001, 1012
SIZE = (320, 180)
SHOT = {"schema": "raystage/shot/3", "name": "cube", "x_note": "kept", "width": 64, "height": 64, "fps": 30, "first_frame": 1,
        "last_frame": 2,
        "camera": {"keys": [{"frame": 1, "position": [0, 0, 0], "horizontal_fov_deg": 50}]},
        "layers": [{"name": "cube", "geometry": {"file": "cube.glb", "samples": 16}}], "lights": [{"ambient": [0.5, 0.5, 0.5]}],
        "output": {"compression": "zip"}}


def run(*command) -> str:
    environment = {**os.environ, "RAYSTAGE": str(BIN / "raystage")}
    done = subprocess.run(list(map(str, command)), text=True, capture_output=True, env=environment, check=False)
    if done.returncode != 0:
        raise AssertionError(f"{command}: {done.stdout}{done.stderr}")
    return done.stdout


def blender(task: str, *arguments) -> dict:
    text = run("blender", "-b", "--factory-startup", "--python-exit-code", "1", "-P", HERE / "addon_scene.py", "--", ADDON, task,
               *arguments)
    found = re.search(r"^RESULT (.*)$", text, re.MULTILINE)
    if found is None:
        raise AssertionError(f"{task} printed no result: {text}")
    return json.loads(found.group(1))


class NukeCamera:
    """The camera of a Nuke script as its node defines it: knobs by frame, ZXY angles, win_translate in half film back widths."""

    def __init__(self, script: str) -> None:
        self.knobs = dict(re.findall(r"^ (\w+) (.*)$", script, re.MULTILINE))

    def values(self, name: str, frame: int) -> list[float]:
        values = []
        for curve, number in re.findall(r"\{curve([^}]*)\}|(-?[\d.]+(?:e-?\d+)?)", self.knobs[name]):
            values.append(float(re.search(rf" x{frame} (\S+)", curve + " ").group(1)) if curve else float(number))
        return values

    def pixel(self, point: list[float], frame: int) -> list[float]:
        x, y, z = (math.radians(angle) for angle in self.values("rotate", frame))
        p = [a - b for a, b in zip(point, self.values("translate", frame))]
        # The camera turns about z, then x, then y: the inverse begins with y.
        p = [p[0] * math.cos(y) - p[2] * math.sin(y), p[1], p[0] * math.sin(y) + p[2] * math.cos(y)]
        p = [p[0], p[1] * math.cos(x) + p[2] * math.sin(x), -p[1] * math.sin(x) + p[2] * math.cos(x)]
        p = [p[0] * math.cos(z) + p[1] * math.sin(z), -p[0] * math.sin(z) + p[1] * math.cos(z), p[2]]
        focal = self.values("focal", frame)[0] / float(self.knobs["haperture"]) * SIZE[0]
        right, up = self.values("win_translate", frame)
        return [SIZE[0] / 2 * (1 - right) + focal * p[0] / -p[2], (SIZE[1] + SIZE[0] * up) / 2 - focal * p[1] / -p[2]]


@unittest.skipUnless(shutil.which("blender"), "Blender is not installed")
@unittest.skipUnless(shutil.which("oiiotool"), "oiiotool is not installed")
class BlenderAddon(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.temporary = tempfile.TemporaryDirectory(prefix="raystage-blender-")
        cls.folder = pathlib.Path(cls.temporary.name)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.temporary.cleanup()

    def write_shot(self, name: str, **members) -> pathlib.Path:
        file = self.folder / name
        file.write_text(json.dumps({**SHOT, **members}))
        return file

    def expect_pixels(self, shot: pathlib.Path, blender_sees: dict, tolerance: float) -> None:
        """The shot's camera shows the corners of the cube at the pixels where Blender shows them, at every frame."""
        run(BIN / "raystage", "camera", shot, "-o", shot.with_suffix(".nk"))
        camera = NukeCamera(shot.with_suffix(".nk").read_text())
        self.assertEqual(len(blender_sees["pixels"]), LAST - FIRST + 1)
        for frame, pixels in blender_sees["pixels"].items():
            for point, expected in zip(blender_sees["points"], pixels):
                found = camera.pixel(point, int(frame))
                self.assertLess(math.dist(found, expected), tolerance, f"frame {frame}: {found}, {expected}")

    def test_a_camera_is_sent_with_all_that_animates_it(self) -> None:
        for fit in ("AUTO", "VERTICAL"):
            file = self.write_shot("sent.json")
            sees = blender("export_shot", file, fit)
            self.expect_pixels(file, sees, 1e-3)
            self.assertEqual(sees["frame"], FIRST + 3, "the scene's frame stays")
            shot = json.loads(file.read_text())
            self.assertEqual(shot["fps"], "24000/1001")
            self.assertEqual((shot["first_frame"], shot["last_frame"]), (FIRST, LAST))
            self.assertEqual((shot["width"], shot["height"]), SIZE)
            self.assertEqual(shot["layers"], SHOT["layers"])
            self.assertEqual(shot["x_note"], "kept")
            self.assertAlmostEqual(shot["camera"]["keys"][0]["f_number"], 2.8, 6)
            self.assertIn("focus_m", shot["camera"]["keys"][-1])
            self.assertNotIn("f_number", shot["camera"]["keys"][-1], "it does not change")

    def test_gltf_of_blender_arrives_at_its_frames(self) -> None:
        sees = blender("export_gltf", self.folder / "blender.glb")
        shot = self.write_shot("gltf.json", width=SIZE[0], height=SIZE[1], fps="24000/1001", first_frame=FIRST, last_frame=LAST,
                               camera={"file": {"path": "blender.glb"}})
        self.expect_pixels(shot, sees, 1e-2)
        shot = self.write_shot("other_rate.json", fps=30, first_frame=FIRST, last_frame=LAST, camera={"file": {"path": "blender.glb"}})
        refused = subprocess.run([BIN / "raystage", "camera", shot, "-o", self.folder / "x.nk"], text=True, capture_output=True, check=False)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("are not at frames of 30 fps", refused.stderr)

    def test_gltf_arrives_in_blender_at_its_frames(self) -> None:
        sent = self.write_shot("back.json")
        blender("export_shot", sent, "AUTO")
        shot = json.loads(sent.read_text())
        for key in shot["camera"]["keys"]:
            for name in ("focal_length_mm", "shift_x", "shift_y"):
                key.pop(name, None)
        shot["camera"]["keys"][0]["focal_length_mm"] = 40
        sent.write_text(json.dumps(shot))
        run(BIN / "raystage", "camera", sent, "--gltf-fps", "24", "-o", self.folder / "back.gltf")
        self.expect_pixels(sent, blender("import_gltf", self.folder / "back.gltf"), 1e-2)

    def test_the_shot_renders_the_cube_that_blender_renders(self) -> None:
        shot = self.write_shot("cube.json")
        blender("render_cube", shot, self.folder / "cube.glb", self.folder / "blender_")
        run(BIN / "raystage", "render", "-q", shot, "-o", self.folder / "ours_####.exr")
        for frame in (FIRST, FIRST + 5, LAST):
            flat = self.folder / "flat.exr"
            run("oiiotool", self.folder / f"ours_{frame}.exr", "--subimage", "0", "--ch", "R,G,B,A", "-o", flat)
            found = blender("compare_masks", self.folder / f"blender_{frame}.exr", flat)
            self.assertGreater(min(found["inside"]), 1000, f"{frame}: {found}")
            self.assertEqual(found["outside"], 0, f"{frame}: {found}")

    def test_meshes_arrive_with_motion_materials_and_packed_textures(self) -> None:
        shot = self.write_shot("materials.json")
        blender("render_materials", shot, self.folder / "box.glb", self.folder / "box.fbx", self.folder / "cycles_")
        document = json.loads(shot.read_text())
        for name, frames in (("box.glb", (FIRST, FIRST + 2, FIRST + 4)), ("box.fbx", (FIRST,))):
            document["layers"] = [{"name": "box", "geometry": {"file": name}}]
            document["output"] = {"aovs": ["albedo"]}
            shot.write_text(json.dumps(document))
            run(BIN / "raystage", "render", "-q", "--layout", "single", shot, "-o", self.folder / f"{name}_####.exr")
            for frame in frames:
                theirs, ours = self.folder / f"theirs_{name}_{frame}.exr", self.folder / f"ours_{name}_{frame}.exr"
                run("oiiotool", self.folder / f"cycles_{frame}.exr", "--ch",
                    "R=ViewLayer.DiffCol.R,G=ViewLayer.DiffCol.G,B=ViewLayer.DiffCol.B,A=ViewLayer.Combined.A", "-o", theirs)
                run("oiiotool", self.folder / f"{name}_{frame}.exr", "--ch", "R=albedo.R,G=albedo.G,B=albedo.B,A", "-o", ours)
                found = blender("compare_colors", theirs, ours)
                self.assertGreater(found["pixels"], 1000, f"{name} {frame}")
                self.assertLess(found["other"], 0.03, f"{name} {frame}")
                outlines = blender("compare_masks", theirs, ours)
                self.assertEqual(outlines["outside"], 0, f"{name} {frame}: {outlines}")

    def test_a_take_arrives_with_its_scene(self) -> None:
        take = self.folder / "take"
        run(BIN / "raystage", "simulate", "still", "-q", "--rows", "3", "--columns", "3", "--width", "160", "--height", "120",
            "--fps", "10", "--seconds", "1", "--truth-views", "0", "--k1", "0", "--k2", "0", "-o", take)
        run(BIN / "raystage", "sync", "-q", take)
        point = [0.3, -0.2, -4]
        found = blender("import_take", take, json.dumps(point))
        rig = json.loads((take / "rig.json").read_text())
        self.assertEqual(len(found["pixels"]), 9)
        for camera in rig["cameras"]:
            m, k = camera["world_from_camera"], camera["intrinsics"]
            away = [p - row[3] for p, row in zip(point, m)]
            x, y, z = (sum(m[row][column] * away[row] for row in range(3)) for column in range(3))
            expected = [k["cx"] + k["fx"] * x / -z, k["cy"] - k["fy"] * y / -z]
            self.assertLess(math.dist(found["pixels"][camera["id"]], expected), 0.01, camera["id"])
        self.assertGreater(found["triangles"][0], 5000)
        document = json.loads((take / "take.json").read_text())
        near, far = document["depth_range_m"]
        self.assertTrue(near * 0.8 < found["middle_depth"] < far * 1.2, found)
        self.assertEqual(found["collections"][-1], "Raystage take")
        self.assertEqual(found["origin"], [0, 0, 0])
        # Far from the origin of the world the proxy keeps its shape.
        far_take = self.folder / "far_take"
        shutil.copytree(take, far_take)
        for camera in rig["cameras"]:
            for row, offset in zip(camera["world_from_camera"], (456789, 210, -5000000)):
                row[3] += offset
        (far_take / "rig.json").write_text(json.dumps(rig))
        far_found = blender("import_take", far_take, json.dumps(point))
        self.assertEqual(far_found["origin"], [456789, 5000000, 210])
        self.assertGreater(far_found["depths"], found["depths"] / 2)
        failed = blender("failed_import", take)
        self.assertIn("the take has 0 to", failed["messages"][0])
        self.assertIn("take.json is missing", failed["messages"][1])
        self.assertEqual(failed["objects"], 0)
        self.assertLessEqual(failed["cameras"], 1, "that of Blender's first scene")
        self.assertFalse([name for name in failed["collections"] if "Raystage" in name])

    def test_stereo_is_sent(self) -> None:
        shot = self.write_shot("stereo.json", camera={"keys": [{"frame": 1, "position": [0, 0, 0], "horizontal_fov_deg": 50}],
                                                      "stereo": {"interaxial_m": 1}})
        for pivot in ("LEFT", "RIGHT"):
            found = blender("export_stereo", shot, pivot)
            stereo = json.loads(shot.read_text())["camera"]["stereo"]
            self.assertAlmostEqual(stereo["interaxial_m"], 0.12, 6)
            self.assertAlmostEqual(stereo["convergence_m"], 3, 6)
            self.assertIn("Off-Axis or Parallel", found["message"])
            # The eye at the pivot is Blender's camera, without convergence.
            script = self.folder / "eye.nk"
            run(BIN / "raystage", "camera", shot, "--eye", pivot.lower(), "-o", script)
            camera = NukeCamera(script.read_text())
            for frame in (FIRST, FIRST + 5, LAST):
                for point, pixel in zip(found["points"], found["pixels"][str(frame)]):
                    self.assertLess(math.dist(camera.pixel(point, frame), pixel), 0.01, f"{pivot} {frame}")

    def test_both_eyes_of_a_render_arrive(self) -> None:
        shot = self.write_shot("eyes.json", width=96, height=54, first_frame=7, last_frame=7,
                               layers=[{"name": "card", "geometry": {"file": "card.obj"}}],
                               camera={"keys": [{"frame": 7, "position": [0, 0, 2], "horizontal_fov_deg": 50}], "stereo": {"interaxial_m": 0.2}})
        (self.folder / "card.obj").write_text("o card\nv -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n")
        for layout in ("standard", "single"):
            run(BIN / "raystage", "render", "-q", shot, "--layout", layout, "-o", self.folder / f"eyes_{layout}.####.exr")
            found = blender("import_render", self.folder / f"eyes_{layout}.0007.exr", self.folder / f"eyes_{layout}.exr", "7")
            self.assertTrue(found["multiview"] and found["depth"], found)
            self.assertEqual(found["picture"], "Combined")

    def test_a_render_arrives_in_the_compositor(self) -> None:
        shot = self.write_shot("render.json", width=96, height=54, fps=25, first_frame=7, last_frame=9,
                               layers=[{"name": "card", "geometry": {"file": "card.obj"}}],
                               camera={"keys": [{"frame": 7, "position": [0, 0, 2], "horizontal_fov_deg": 50}, {"frame": 9, "position": [1, 0, 2]}]},
                               output={"compression": "zip", "cryptomatte": True,
                                       "color": {"color_space": "lin_ap1_scene", "working_space": "lin_ap1_scene"}})
        (self.folder / "card.obj").write_text("o card\nv -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n")
        run(BIN / "raystage", "render", "-q", shot, "-o", self.folder / "r.####.exr")
        found = blender("import_render", self.folder / "r.0007.exr", self.folder / "composed.exr", "8")
        self.assertIn(found["space"], ("Linear ACEScg", "ACEScg"))
        self.assertEqual((found["duration"], found["start"], found["range"], found["current"]), (3, 7, [7, 9], 7))
        self.assertEqual(found["size"], [96, 54])
        self.assertAlmostEqual(found["fps"], 25, 3)
        self.assertTrue(found["matte"] and found["depth"])
        # Frame 8 of the scene shows file 8.
        def difference(frame: int) -> float:
            text = run("oiiotool", self.folder / "composed.exr", "--ch", "A", self.folder / f"r.{frame:04}.exr", "--ch", "A",
                       "--absdiff", "--printstats")
            return max(map(float, re.search(r"Max: *(\S+)", text).group(1).split()))
        self.assertLess(difference(8), 1e-3)
        self.assertGreater(difference(7), 0.5)
        # Blender converts colours from ACEScg, but not positions and normals.
        self.assertEqual(found["spaces"][1:], ["Non-Color"])
        for name in ("P", "N"):
            text = run("oiiotool", self.folder / f"composed.exr.passes/{name}0008.exr", "--ch", "R,G,B", self.folder / "r.0008.exr",
                       "--ch", f"R={name}.X,G={name}.Y,B={name}.Z", "--absdiff", "--printstats")
            self.assertLess(max(map(float, re.search(r"Max: *(.*)", text).group(1).split()[:3])), 1e-3, name)


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
