#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Our EXR files in Blender: every pass arrives in the compositor with the values of the file.

    blender_exr_test.py [TEST]

RAYSTAGE_BIN_DIR: folder of the programs (default: build/check/bin). Skipped without Blender or oiiotool.
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BIN = pathlib.Path(os.environ.get("RAYSTAGE_BIN_DIR", ROOT / "build/check/bin"))
SIZE = (80, 60)
TWO_SQUARES = """o left
v -0.2 -0.2 0.2
v 0.2 -0.2 0.2
v 0.2 0.2 0.2
v -0.2 0.2 0.2
f 1 2 3 4
o right
v 0.3 -0.2 0
v 0.6 -0.2 0
v 0.6 0.2 0
v 0.3 0.2 0
f 5 6 7 8
"""
SHOT = {
    "schema": "raystage/shot/2", "width": SIZE[0], "height": SIZE[1], "fps": 24, "first_frame": 1, "last_frame": 1,
    "camera": {"keys": [{"frame": 1, "position": [0, 0, 0], "orientation": [1, 0, 0, 0], "horizontal_fov_deg": 50}]},
    "merge": "depth", "lights": [{"ambient": [0.5, 0.5, 0.5]}],
    "layers": [
        {"name": "set", "take": "take", "method": "focal_plane", "focal_plane": {"depth_m": 4.5}, "speed": 0},
        {"name": "cards", "geometry": {"file": "cards.obj", "material": {"kind": "diffuse", "color": [0.7, 0.6, 0.5]},
                                       "keys": [{"frame": 1, "position": [0, 0, -2]}], "samples": 16}},
    ],
}
# Pass of Blender: channels of the file.
PASSES = {
    "Combined": ["R", "G", "B", "A"], "Depth": ["Z"], "P": ["P.X", "P.Y", "P.Z"], "N": ["N.X", "N.Y", "N.Z"],
    "albedo": ["albedo.R", "albedo.G", "albedo.B"], "motion": ["motion.X", "motion.Y", "motion.Z", "motion.W"],
    "coverage": ["coverage.V"], "confidence": ["confidence.V"], "cameras": ["cameras.V"], "nearest": ["nearest.V"],
    **{f"CryptoObject{i:02}": [f"CryptoObject{i:02}.{c}" for c in "RGBA"] for i in range(3)},
}


def run(*command, **options) -> str:
    return subprocess.run(list(map(str, command)), check=True, text=True, capture_output=True, **options).stdout


@unittest.skipUnless(shutil.which("blender"), "Blender is not installed")
@unittest.skipUnless(shutil.which("oiiotool"), "oiiotool is not installed")
class BlenderExr(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.temporary = tempfile.TemporaryDirectory(prefix="raystage-blender-")
        cls.folder = pathlib.Path(cls.temporary.name)
        run(BIN / "raystage", "simulate", "still", "-q", "--rows", "3", "--columns", "3", "--width", "160", "--height", "120",
            "--fps", "10", "--seconds", "1", "--truth-views", "0", "-o", cls.folder / "take")
        run(BIN / "raystage", "sync", "-q", cls.folder / "take")
        (cls.folder / "cards.obj").write_text(TWO_SQUARES)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.temporary.cleanup()

    def render(self, name: str, output: dict, **members) -> pathlib.Path:
        shot = self.folder / f"{name}.json"
        shot.write_text(json.dumps({**SHOT, "output": output, **members}))
        run(BIN / "raystage", "render", "-q", shot, "-o", self.folder / f"{name}.####.exr")
        return self.folder / f"{name}.0001.exr"

    def read_in_blender(self, file: pathlib.Path, *objects: str) -> tuple[pathlib.Path, list, str]:
        """Returns the folder of the passes, their layers and names, and what Blender printed."""
        folder = self.folder / (file.stem + "-passes")
        home = self.folder / "home"
        home.mkdir(exist_ok=True)
        found = subprocess.run(
            ["blender", "-b", "--factory-startup", "-noaudio", "-t", "1", "-P", str(pathlib.Path(__file__).parent / "read_passes.py"), "--",
             str(file), str(folder), *map(str, SIZE), *objects],
            text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300, env={**os.environ, "HOME": str(home)})
        [line] = [line for line in found.stdout.splitlines() if line.startswith("PASSES ")] or self.fail(found.stdout)
        self.assertEqual(json.loads(line[7:])["type"], "MULTILAYER")
        return folder, json.loads(line[7:])["passes"], found.stdout

    def channels(self, file: pathlib.Path, channels: list) -> pathlib.Path:
        """Writes channels of a file as R, G and B, or R, G, B and A, floats; of one channel all are equal, as Blender writes them."""
        index = next(i for i, part in enumerate(self.parts(file)) if set(channels) <= set(part))
        picked = channels * 3 if len(channels) == 1 else channels
        to = self.folder / "channels.exr"
        run("oiiotool", file, "--subimage", index, "--ch", ",".join(f"{to}={of}" for to, of in zip("RGBA", picked)), "-d", "float", "-o", to)
        return to

    def parts(self, file: pathlib.Path) -> list:
        """Returns the names of the channels of each part."""
        text = run("oiiotool", "-v", "--info", "-a", file)
        return [line.split("channel list:")[1].replace(" (half)", "").replace(" (float)", "").replace(" ", "").split(",")
                for line in text.splitlines() if "channel list:" in line]

    def expect_all_passes(self, file: pathlib.Path, expected: set) -> None:
        folder, passes, printed = self.read_in_blender(file)
        for complaint in ("unknown channel", "no rect set", "ERROR"):
            self.assertNotIn(complaint, printed)
        self.assertEqual({name for _, name in passes if name != "Alpha"}, expected)
        for number, (_, name) in enumerate(passes):
            if name == "Alpha":
                continue
            file_of_pass = folder / f"{number}_0001.exr"
            original = self.channels(file, PASSES[name])
            command = ["oiiotool", file_of_pass, "--ch", "R,G,B" if len(PASSES[name]) < 4 else "R,G,B,A", "--clamp:max=1e30", original,
                       "--clamp:max=1e30", "--fail", "0", "--diff"]  # the difference of infinities is no number
            compared = subprocess.run(list(map(str, command)), text=True, capture_output=True)
            self.assertEqual(compared.returncode, 0, f"{name}: {compared.stdout}")

    def test_every_pass_arrives(self) -> None:
        always = {"Combined", "Depth", "P", "N", "albedo", "coverage"}
        for compression in ("zip", "piz"):
            for layout in ("standard", "single"):
                with self.subTest(layout=layout, compression=compression):
                    self.expect_all_passes(self.render(f"{layout}-{compression}", {"layout": layout, "compression": compression}), always)
        with self.subTest("all measures"):
            aovs = ["lf.coverage", "lf.confidence", "lf.cameras", "lf.nearest", "P", "N", "albedo"]
            self.expect_all_passes(self.render("measures", {"aovs": aovs}), always | {"confidence", "cameras", "nearest"})

    def test_motion_blurs_what_moves(self) -> None:
        cards = {**SHOT["layers"][1], "geometry": {**SHOT["layers"][1]["geometry"], "keys": [
            {"frame": 1, "position": [-0.2, 0, -2]}, {"frame": 3, "position": [0.2, 0, -2]}]}}
        aovs = ["P", "N", "albedo", "motion"]
        file = self.render("moving", {"aovs": aovs}, schema="raystage/shot/3", layers=[cards], first_frame=2, last_frame=2)
        file = file.with_name("moving.0002.exr")
        self.expect_all_passes(file, {"Combined", "Depth", "P", "N", "albedo", "motion"})
        folder = self.folder / (file.stem + "-passes")

        def profile(of: pathlib.Path, crop: str) -> list:
            """Returns R of a row or column of pixels, relative to the squares' own."""
            line = self.folder / "line.exr"
            run("oiiotool", of, "--subimage", 0, "--ch", "R", "--crop", crop, "-d", "float", "-o", line)
            text = run("oiiotool", "--dumpdata", line)
            values = [float(pixel.rsplit(":", 1)[1].split()[0]) for pixel in text.splitlines() if pixel.strip().startswith("Pixel")]
            return [value / 0.35 for value in values]

        row, column = f"{SIZE[0]}x1+0+{SIZE[1] // 2}", f"1x{SIZE[1]}+{SIZE[0] // 2}+0"
        blurred = folder / "blurred_0001.exr"
        edges = lambda values: sum(0.02 < value < 0.98 for value in values)
        # The squares move by 8.6 pixels a frame, to the right only.
        self.assertLessEqual(edges(profile(file, row)), 4)
        self.assertGreaterEqual(edges(profile(blurred, row)), 9)
        self.assertEqual(edges(profile(blurred, column)), edges(profile(file, column)))

    def test_cryptomatte_picks_each_object(self) -> None:
        file = self.render("crypto", {"cryptomatte": True, "compression": "zip"})
        self.expect_all_passes(file, {"Combined", "Depth", "P", "N", "albedo", "coverage", "CryptoObject00", "CryptoObject01", "CryptoObject02"})
        folder, _, _ = self.read_in_blender(file, "cards/left", "cards/right", "set")
        alone = []
        for number in range(3):
            stats = run("oiiotool", folder / f"object_{number}_0001.exr", "--ch", "R", "--printstats")
            alone.append(float(stats.split("Stats Avg:")[1].split()[0]))
        # The squares' shares of the view, 2 m and 1.8 m away: 0.3 x 0.4 m and 0.4 x 0.4 m.
        view = 4 * 0.466307658 ** 2 * SIZE[1] / SIZE[0]
        self.assertAlmostEqual(alone[0], 0.16 / (view * 1.8 ** 2), delta=0.004)
        self.assertAlmostEqual(alone[1], 0.12 / (view * 2 ** 2), delta=0.004)
        self.assertAlmostEqual(sum(alone), 1, delta=0.01)

    def test_both_eyes_arrive(self) -> None:
        camera = {**SHOT["camera"], "stereo": {"interaxial_m": 0.06}}
        for output in ({}, {"layout": "single"}):
            with self.subTest(output=output):
                file = self.render("stereo" + output.get("layout", ""), output, camera=camera)
                _, passes, printed = self.read_in_blender(file)
                self.assertNotIn("ERROR", printed)
                self.assertLessEqual({"Combined", "Depth", "P", "N", "albedo", "coverage"}, {name for _, name in passes})


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
