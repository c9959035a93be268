#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests the viewer's page in Chromium: source frames, comparisons, stereo, notes, recovery, folders and recordings."""
import json
import math
import pathlib
import shutil
import statistics
import struct
import subprocess
import sys
import tempfile
import time
import unittest

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from viewer_page import BIN, WAIT_SECONDS, PageTest, Viewer, run


class Cameras(PageTest):
    """What the cameras recorded."""

    def setUp(self) -> None:
        super().setUp()
        self.js("document.getElementById('mosaic').closest('details').open = true")

    def test_a_mosaic_shows_all_cameras_and_opens_one(self) -> None:
        self.element("mosaic").click()
        self.wait_for("return raystage.sources.cells.length === 9")
        self.screenshot("mosaic")
        cells = self.js("return raystage.sources.cells")
        self.assertEqual({cell["id"] for cell in cells}, {f"r{row}c{column}" for row in range(3) for column in range(3)})
        where = {cell["id"]: cell["box"] for cell in cells}
        self.assertLess(where["r0c0"][0], where["r0c1"][0])
        x, y, width, height = where["r1c2"]
        canvas = self.element("sources")
        ActionChains(self.browser).move_to_element_with_offset(
            canvas, int(x + width / 2 - canvas.size["width"] / 2), int(y + height / 2 - canvas.size["height"] / 2)).click().perform()
        self.wait_for("return raystage.sources.mode === 'source' && raystage.sources.camera === 'r1c2' && raystage.sources.cells.length === 0")
        self.screenshot("source")
        self.element("picture").send_keys(Keys.ESCAPE)
        self.wait_for("return raystage.sources.mode === 'mosaic' && raystage.sources.cells.length === 9")
        self.element("picture").send_keys("m")
        self.assertEqual(self.js("return raystage.sources.mode"), "view")
        self.assertTrue(self.js("return document.getElementById('sources').hidden"))

    def test_the_mosaic_follows_the_time(self) -> None:
        self.element("mosaic").click()
        self.wait_for("return raystage.sources.cells.length === 9 && !raystage.sources.underWay")
        asked = """const before = raystage.connection.nextId; raystage.timeline.go(7); return before"""
        before = self.js(asked)
        self.wait_for("return raystage.connection.nextId > arguments[0] && !raystage.sources.underWay", before)

    def test_the_epipolar_plane_image_follows_the_cursor(self) -> None:
        self.element("epi-on").click()
        picture = self.element("picture")
        ActionChains(self.browser).move_to_element_with_offset(picture, 20, 30).perform()
        self.wait_for("return raystage.sources.epi")
        epi = self.js("return raystage.sources.epi")
        self.assertEqual(len(epi["cameras"]), 3)
        self.assertEqual(len(epi["focus_columns"]), 3)
        self.assertGreater(len(epi["view_line"]), 10)
        columns = [column for column in epi["focus_columns"] if column is not None]
        self.assertEqual(columns, sorted(columns, reverse=True), "a point moves to the left from camera to camera to the right")
        bottom, top = self.js("""const box = (id) => document.getElementById(id).getBoundingClientRect();
          return [box('picture').bottom, box('epi').top]""")
        self.assertLessEqual(bottom, top + 0.5, "the picture is not covered")
        self.screenshot("epi")

    def test_the_probe_names_the_cameras(self) -> None:
        ActionChains(self.browser).move_to_element_with_offset(self.element("picture"), 5, 5).perform()
        self.wait_for("return document.getElementById('readout').textContent.includes('cameras ')")
        self.assertIn("r1c1", self.element("readout").text)


class Fisheyes(PageTest):
    """An array of fisheyes."""

    TAKE = ("--lens", "ftheta", "--fov-deg", "180", "--k1", "0", "--k2", "0", "--lens-deviation", "0")

    def blue(self) -> int:
        """Returns how many pixels of the map show cameras."""
        return self.js("""return new Promise(requestAnimationFrame).then(() => new Promise(requestAnimationFrame)).then(() => {
          const c = document.getElementById('map'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
          let n = 0; for (let i = 0; i < d.length; i += 4) n += d[i + 2] > d[i] + 30 && d[i + 2] > d[i + 1] + 15; return n })""")

    def test_the_map_draws_their_axes_and_half_angles(self) -> None:
        self.refined()
        cameras = self.js("return raystage.state.shot.layers[0].cameras")
        self.assertEqual(len(cameras), 9)
        for camera in cameras:  # the width shows 180 degrees; the corners are 1.25 times as far from the middle
            self.assertAlmostEqual(camera["half_angle"], 1.25 * math.pi / 2, delta=0.03)
        drawn = self.blue()
        self.screenshot("fisheyes")
        self.js("""for (const camera of raystage.state.shot.layers[0].cameras) delete camera.half_angle;
          raystage.setCamera({ ...raystage.camera() })""")
        self.refined()
        self.assertGreater(drawn, 1.5 * self.blue(), "more than dots")


class Comparing(PageTest):
    """The wipe."""

    def column(self, share: float) -> list:
        return self.js("""const c = document.getElementById('picture');
          return [...c.getContext('2d').getImageData(Math.floor(arguments[0] * (c.width - 1)), 0, 1, c.height).data]""", share)

    def compare(self, kind: str) -> None:
        self.js("document.getElementById('compare').closest('details').open = true")
        Select(self.element("compare")).select_by_value(kind)

    def compared(self) -> None:
        self.wait_for("return raystage.view.isCompared() && !raystage.view.wanted && raystage.view.underWay.size === 0")
        self.js("return new Promise(requestAnimationFrame)")

    def difference_at(self, a: list, b: list) -> float:
        return self.difference(a, b)

    def test_methods_are_compared_by_a_wipe(self) -> None:
        self.refined()
        left, right = self.column(0.25), self.column(0.75)
        self.compare("method nearest")
        self.compared()
        self.assertLess(self.difference(self.column(0.25), left), 0.01)
        self.assertGreater(self.difference(self.column(0.75), right), 0.2)
        self.assertEqual(self.js("return raystage.view.compared()"), [self.js("return raystage.state.shot.layers[0].method"), "nearest"])
        self.screenshot("wipe")
        self.js("""const wipe = document.getElementById('wipe'); wipe.value = 1; wipe.dispatchEvent(new Event('input'));
          return new Promise(requestAnimationFrame)""")
        self.assertLess(self.difference(self.column(0.75), right), 0.01)

    def test_kept_settings_are_compared_with_new_ones(self) -> None:
        self.refined()
        right = self.column(0.75)
        self.js("document.getElementById('compare').closest('details').open = true")
        self.element("keep").click()
        self.compared()
        self.assertLess(self.difference(self.column(0.75), right), 0.01)
        Select(self.element("method-0")).select_by_value("nearest")
        self.wait_for("return raystage.state.shot.layers[0].method === 'nearest'")
        self.compared()
        self.assertLess(self.difference(self.column(0.75), right), 0.01, "right of the wipe: as it was kept")

    def test_a_rendered_sequence_is_compared_with_the_view(self) -> None:
        self.js("raystage.connection.ask('save', {file: 'rendered.json', replace: true, text: raystage.shotText.text()})")
        self.wait_for("return !raystage.connection.waiting.size")
        run("render", self.root / "rendered.json", "--frames", "1-2", "-o", self.root / "renders/shot.####.exr", "-q")
        self.refined()
        right = self.column(0.9)  # beside the names at the wipe
        self.compare("sequence")
        self.element("compare-file").send_keys("renders/shot.####.exr", Keys.TAB)
        self.compared()
        self.assertLess(self.difference(self.column(0.9), right), 5, "the same pictures, but for the size")
        self.element("compare-file").clear()
        self.element("compare-file").send_keys("missing.####.exr", Keys.TAB)
        self.wait_for("return document.getElementById('status').textContent.includes('missing')")

    def test_another_shot_is_compared(self) -> None:
        self.js("""const json = JSON.parse(raystage.shotText.text()); json.layers[0].method = 'nearest';
          raystage.connection.ask('save', {file: 'other.json', replace: true, text: JSON.stringify(json)})""")
        self.wait_for("return !raystage.connection.waiting.size")
        self.refined()
        right = self.column(0.75)
        self.compare("file")
        self.element("compare-file").send_keys("other.json", Keys.TAB)
        self.compared()
        self.assertGreater(self.difference(self.column(0.75), right), 0.2)


class Stereo(PageTest):
    def choose(self, value: str) -> dict:
        Select(self.element("arrangement")).select_by_value(value)
        return self.refined()

    def half(self, left: float) -> list:
        return self.js("""const small = document.createElement('canvas'), c = document.getElementById('picture');
          small.width = 32; small.height = 24;
          small.getContext('2d').drawImage(c, arguments[0] * c.width, 0, c.width / 2, c.height, 0, 0, 32, 24);
          return [...small.getContext('2d').getImageData(0, 0, 32, 24).data]""", left)

    def test_side_by_side_shows_both_eyes(self) -> None:
        self.choose("side_by_side")
        left, right = self.half(0), self.half(0.5)
        self.assertGreater(self.difference(left, right), 0.5)
        self.assertLess(self.difference(left, right), 25, "the eyes see the same scene")
        self.screenshot("side-by-side")

    def test_an_anaglyph_and_a_quilt(self) -> None:
        single = self.pixels()
        self.choose("anaglyph")
        anaglyph = self.pixels()
        self.assertGreater(self.difference(anaglyph, single), 0.5)
        self.screenshot("anaglyph")
        header = self.choose("quilt")
        self.assertEqual(header["width"] % 8, 0)
        self.assertEqual(header["height"] % 6, 0)
        self.screenshot("quilt")
        self.element("snapshot").click()
        self.element("file-name").clear()
        self.element("file-name").send_keys("quilt.png", Keys.ENTER)
        self.wait_for("return document.getElementById('status').textContent === 'Written quilt.png'")
        size = struct.unpack(">II", (self.root / "quilt.png").read_bytes()[16:24])
        self.assertEqual(size, (8 * 160, 6 * 120))
        self.assertGreater(self.difference(self.pixels(), single), 5)

    def test_confidence_is_a_channel(self) -> None:
        color = self.pixels()
        Select(self.element("channel")).select_by_value("confidence")
        confidence = self.pixels()
        self.assertGreater(self.difference(confidence, color), 5)
        self.assertGreater(sum(confidence[0::4]) / len(confidence[0::4]), 60, "most of a still scene agrees")
        self.screenshot("confidence")

    def test_a_headset_sees_the_scene_where_it_is(self) -> None:
        # Without a headset: the geometry of its pictures. A picture for the pose of the head is where it was, and a
        # turned head looks elsewhere from there.
        corners = self.js("""
          const {headCamera, pictureCorners} = raystage.headset, base = raystage.camera();
          const still = headCamera(base, [0, 0, 0], [1, 0, 0, 0]), moved = headCamera(base, [0.1, 0, 0], [1, 0, 0, 0]);
          return [pictureCorners(base, still, 1), pictureCorners(base, moved, 1), base.focus_m]""")
        still, moved, focus = corners
        self.assertAlmostEqual(still[2], -focus, 6)
        self.assertAlmostEqual(still[0], -still[5], 6)
        self.assertAlmostEqual(moved[0] - still[0], 0.1, 6)
        self.assertTrue(self.js("return document.getElementById('headset').hidden"), "this browser has no headset")


class NotesAndRecovery(PageTest):
    def note(self, text: str) -> None:
        self.js("document.getElementById('note').closest('details').open = true")
        self.element("note").send_keys(text)
        self.element("add-note").click()
        self.wait_for("return !raystage.connection.waiting.size && document.getElementById('note').value === ''")

    def test_notes_are_kept_beside_the_shot(self) -> None:
        self.js("raystage.timeline.go(4)")
        self.note("the left hand is soft <b>here</b>")
        self.js("raystage.timeline.go(9)")
        self.note("good")
        self.screenshot("notes")
        document = json.loads((self.root / "take.shot.notes.json").read_text())
        self.assertEqual([note["frame"] for note in document["notes"]], [4, 9])
        self.open_page(self.viewer.url)
        self.js("document.getElementById('note').closest('details').open = true")
        self.assertIn("<b>here</b>", self.element("notes").text)
        self.js("document.querySelector('#notes button').click()")
        self.assertEqual(self.js("return raystage.timeline.frame"), 4)
        for _ in range(2):
            self.js("document.querySelector('#notes li button:last-child').click()")
            self.wait_for("return !raystage.connection.waiting.size")
        self.assertEqual(json.loads((self.root / "take.shot.notes.json").read_text())["notes"], [])

    def test_notes_of_two_pages_are_all_kept(self) -> None:
        (self.root / "take.shot.notes.json").unlink(missing_ok=True)
        self.open_page(self.viewer.url)
        self.note("first")
        path = self.root / "take.shot.notes.json"
        document = json.loads(path.read_text())
        document["notes"].append({"frame": 2, "text": "of another page"})
        path.write_text(json.dumps(document))
        self.note("second")
        self.assertEqual({note["text"] for note in json.loads(path.read_text())["notes"]}, {"first", "of another page", "second"})
        path.unlink()

    def change(self) -> None:
        self.js("raystage.timeline.go(6); raystage.setCamera({...raystage.camera(), position: [0.04, 0, 0.01]})")
        self.element("set-key").click()
        self.wait_for("return raystage.shotText.keyAt(6)")

    def test_unsaved_work_survives_a_crash(self) -> None:
        self.change()
        kept = self.root / "take.shot.autosave.json"
        deadline = time.monotonic() + WAIT_SECONDS
        while not (is_kept := kept.exists() and "0.04" in kept.read_text()) and time.monotonic() < deadline:
            time.sleep(0.05)
        self.assertTrue(is_kept)
        self.browser.get("about:blank")
        self.viewer.process.kill()
        self.viewer.process.wait()
        self.viewer.process.stdout.close()
        type(self).viewer = Viewer(self.root / "take")
        self.open_page(self.viewer.url)
        self.assertIsNone(self.js("return raystage.shotText.keyAt(6) ?? null"))
        self.assertTrue(self.element("recovery").is_displayed())
        self.screenshot("recovery")
        self.element("recover").click()
        self.wait_for("return raystage.shotText.keyAt(6)?.position[0] === 0.04")
        self.wait_for("return raystage.state.shot.path[5].position[0] === 0.04")
        self.element("undo").click()
        self.wait_for("return !raystage.shotText.keyAt(6)")
        # Nothing is unsaved any more: nothing is kept.
        deadline = time.monotonic() + WAIT_SECONDS
        while kept.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        self.assertFalse(kept.exists())

    def test_ease_and_tension_change_the_path(self) -> None:
        self.js("raystage.timeline.go(15); raystage.setCamera({...raystage.camera(), position: [0.1, 0, 0]})")
        self.element("set-key").click()
        self.wait_for("return raystage.state.shot.path[14].position[0] === 0.1")
        middle = "return raystage.state.shot.path[4].position[0]"
        before = self.js(middle)
        self.js("raystage.timeline.go(1)")
        self.element("ease-out").clear()
        self.element("ease-out").send_keys("1", Keys.TAB)
        self.wait_for("return raystage.state.shot.path[4].position[0] < arguments[0] - 0.003", before)
        self.assertEqual(self.js("return raystage.shotText.keyAt(1).ease_out"), 1)
        self.screenshot("ease")

    def test_the_camera_is_exported(self) -> None:
        for extension, content in ((".chan", "1\t0"), (".gltf", '"cameras"'), (".nk", "Camera2 {")):
            self.element("export").click()
            self.element("file-name").clear()
            self.element("file-name").send_keys("camera" + extension, Keys.ENTER)
            self.wait_for("return document.getElementById('status').textContent === arguments[0]", f"Written camera{extension}")
            text = (self.root / ("camera" + extension)).read_text()
            self.assertIn(content.replace("\t", " ") if extension == ".chan" and "\t" not in text else content, text)
        # As the command writes it.
        self.js("raystage.connection.ask('save', {file: 'exported.json', replace: true, text: raystage.shotText.text()})")
        self.wait_for("return !raystage.connection.waiting.size")
        run("camera", self.root / "exported.json", "-o", self.root / "command.nk")
        self.assertEqual((self.root / "camera.nk").read_text(), (self.root / "command.nk").read_text())

    def test_nothing_is_written_into_the_take(self) -> None:
        answer = self.js("""return raystage.connection.ask('save', {file: 'take/new.json', text: raystage.shotText.text()})
          .then(() => '', (error) => error.message)""")
        self.assertIn("inside of a take", answer)
        self.assertFalse((self.root / "take/new.json").exists())


class Progress(PageTest):
    def test_depths_are_estimated_with_progress_and_can_be_cancelled(self) -> None:
        self.js("""globalThis.progress = [];
          const message = raystage.connection.handlers.message;
          raystage.connection.handlers.message = (m) => { if (m.type === 'progress') progress.push(m.share); message(m); };""")
        self.js("raystage.shotText.change(json => { json.width = 1280; json.height = 960; })")
        self.js("""globalThis.methods = []; const picture = raystage.view.shown.picture;
          raystage.view.shown.picture = (header) => { methods.push([header.quality, header.method]); picture(header); };""")
        Select(self.element("method-0")).select_by_value("depth")
        self.wait_for("return methods.some(([quality, method]) => quality === 'resting' && method === '')")
        self.assertIn(["resting", "plane_sweep"], self.js("return methods"))
        shares = self.js("return progress")
        self.assertEqual(shares, sorted(shares))
        self.assertTrue(self.element("progress-row").get_property("hidden"))
        # The button ends the wait of the page; that the renderer ends is tested by RenderScheduler.
        self.js("raystage.timeline.go(raystage.timeline.frame + 3); methods.length = 0; raystage.view.rest()")
        self.wait_for("return methods.some(([, method]) => method === 'plane_sweep')")
        self.js("document.getElementById('cancel').click()")
        self.assertEqual(self.js("return raystage.view.underWay.size"), 0)
        for share in shares:
            self.assertTrue(0 <= share <= 1)
        self.js("raystage.timeline.go(11)")
        self.js("raystage.view.rest()")
        self.element("picture").send_keys("")
        self.js("raystage.connection.send('cancel', {})")
        self.wait_for("return raystage.view.underWay.size === 0")


CARD = """v -0.3 -0.3 0
v 0.3 -0.3 0
v 0.3 0.3 0
v -0.3 0.3 0
f 1 2 3 4
"""


class Composed(PageTest):
    """A shot of several layers, opened from its file; shots in a folder that does not hold the take."""

    def shot(self) -> pathlib.Path:
        document = json.loads((self.root / "take/shot.json").read_text())
        document["layers"][0].update(take="take", method="focal_plane")
        document.update(merge="depth", lights=[{"ambient": [1, 1, 1]}], width=160, height=120)
        document["camera"] = {"keys": [{"frame": document["first_frame"], "position": [0, 0, 0], "orientation": [1, 0, 0, 0],
                                        "horizontal_fov_deg": 50, "focus_m": 4}], "stereo": {"interaxial_m": 0.06}}
        document["layers"].append({"name": "card", "geometry": {
            "file": "card.obj", "material": {"kind": "diffuse", "color": [1, 0, 0]}, "keys": [{"frame": 1, "position": [0, 0, -2]}], "samples": 4}})
        (self.root / "card.obj").write_text(CARD)
        path = self.root / "composed.json"
        path.write_text(json.dumps(document))
        return path

    def test_all_layers_are_shown(self) -> None:
        viewer = Viewer(self.shot())
        try:
            self.open_page(viewer.url)
            self.refined()
            self.assertEqual(self.js("return raystage.state.shot.layers.map((layer) => layer.name)")[-1], "card")
            middle = """const c = document.getElementById('picture');
              return [...c.getContext('2d').getImageData(c.width / 2 + arguments[0], c.height / 2, 1, 1).data]"""
            red, green, blue, _ = self.js(middle, 0)
            self.assertGreater(red, 200)
            self.assertLess(max(green, blue), 60)
            self.screenshot("composed")
            Select(self.element("arrangement")).select_by_value("side_by_side")
            for x in (-0.25, 0.25):
                self.wait_for("""const c = document.getElementById('picture'), [r, g] = c.getContext('2d').getImageData(
                  c.width * (0.5 + arguments[0]), c.height / 2, 1, 1).data; return r > 200 && g < 60""", x)
            self.screenshot("composed-stereo")
            for eye in ("left", "right"):
                Select(self.element("arrangement")).select_by_value(eye)
                self.element("snapshot").click()
                self.element("file-name").clear()
                self.element("file-name").send_keys(f"{eye}.exr", Keys.ENTER)
                self.wait_for("return document.getElementById('status').textContent === arguments[0]", f"Written {eye}.exr")
                self.assertGreater((self.root / f"{eye}.exr").stat().st_size, 10_000)
        finally:
            self.leave_and_end(viewer)

    def test_shots_may_be_in_another_folder(self) -> None:
        with tempfile.TemporaryDirectory() as shots:
            for target in (self.root / "take", self.shot()):
                viewer = Viewer(target, "--shots", shots)
                try:
                    self.open_page(viewer.url)
                    self.refined()
                    name = self.js("return raystage.shotText.file")
                    self.assertNotIn("/", name)
                    self.element("save").click()
                    self.element("file-name").send_keys(Keys.ENTER)
                    self.wait_for("return document.getElementById('status').textContent === arguments[0]", "Saved " + name)
                    run("render", pathlib.Path(shots) / name, "--frames", "1", "-o", self.root / "other.####.exr", "-q", "--existing", "overwrite")
                finally:
                    self.leave_and_end(viewer)


class Folders(PageTest):
    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        run("verify", cls.root / "take", "--json", cls.root / "take.verify.json", "-q")
        (cls.root / "more").mkdir()
        shutil.copytree(cls.root / "take", cls.root / "more/second")
        (cls.root / "more/damaged").mkdir()
        (cls.root / "more/damaged/take.json").write_text("{")
        cls.folder_viewer = Viewer(cls.root)

    @classmethod
    def tearDownClass(cls) -> None:
        assert cls.folder_viewer.end() == 0
        super().tearDownClass()

    def card(self, name: str):
        return next(card for card in self.browser.find_elements("class name", "card") if card.text.split("\n")[0] == name)

    def setUp(self) -> None:
        self.browser.get(self.folder_viewer.url)
        self.wait_for("return document.querySelectorAll('.card').length > 0")

    def test_takes_are_cards_that_open(self) -> None:
        card = self.card("take")
        self.assertIn("9 cameras, 2.0 s", card.text)
        self.assertIn("Verified 20", card.text)
        self.wait_for("""return [...document.querySelector('.card.take canvas').getContext('2d').getImageData(0, 0, 240, 150).data]
          .some(v => v > 60 && v < 255)""")
        self.screenshot("folder")
        card.click()
        self.wait_for("return raystage.state.picture?.final")
        self.assertEqual(self.js("return raystage.shotText.file"), "take.shot.json")
        self.assertFalse(self.element("cards").is_displayed())

    def test_folders_are_entered_and_left(self) -> None:
        self.card("more").click()
        self.wait_for("return document.querySelector('#cards h2').textContent === 'more'")
        self.assertIn("Not verified", self.card("second").text)
        self.assertIn("Cannot be opened", self.card("damaged").text)
        self.assertFalse(self.card("damaged").is_enabled())
        self.card("second").click()
        self.wait_for("return raystage.state.picture?.final")
        self.assertEqual(self.js("return raystage.shotText.file"), "more/second.shot.json")
        self.element("picture").send_keys(Keys.CONTROL, "l")
        self.wait_for("return !document.getElementById('cards').hidden")
        self.card("..").click()
        self.wait_for("return document.querySelector('#cards h2').textContent === 'Takes and shots'")


class Recording(PageTest):
    """A take that is being recorded."""

    def record(self, take: str, *options: str) -> subprocess.Popen:
        config = self.root / "record.json"
        config.write_text(json.dumps({
            "schema": "raystage/record/1", "name": "live", "memory_mb": 200,
            "cameras": [{"id": f"c{i}", "simulated": {"index": i, "rows": 2, "columns": 2, "width": 160, "height": 120, "fps": 10}}
                        for i in range(4)]}))
        return subprocess.Popen([str(BIN / "raystage"), "record", str(config), "-o", str(self.root / take), "-q",
                                 "--duration", "60", *options])

    def follow(self, take: str, condition: str) -> None:
        while not (self.root / take / "take.json").exists():
            time.sleep(0.05)
        viewer = Viewer(self.root / take)
        try:
            self.browser.get(viewer.url)
            self.wait_for(condition)
        except BaseException:
            viewer.end()
            raise
        self.live_viewer = viewer

    def ages(self) -> list[float]:
        """Returns how old the newest instant was in each of the next 15 statuses, in seconds."""
        return self.browser.execute_async_script("""
          const done = arguments[0], ages = [];
          let last = raystage.live.status;
          const timer = setInterval(() => {
            if (raystage.live.status === last) return;
            last = raystage.live.status;
            ages.push(last.age_s);
            if (ages.length === 15) { clearInterval(timer); done(ages); }
          }, 20)""")

    def test_the_newest_instant_is_shown_and_how_the_cameras_do(self) -> None:
        recorder = self.record("live")
        try:
            self.follow("live", "return raystage.live.status?.cameras.every(c => c.fps > 5) && raystage.sources.cells.every(c => !c.absent)")
            self.wait_for("return raystage.live.status.age_s < 1.5")
            self.assertLess(statistics.median(self.ages()), 1.5)
            self.assertEqual(self.js("return raystage.live.status.cameras.map(c => c.dropped)"), [0] * 4)
            self.screenshot("live-mosaic")
            self.browser.find_element("tag name", "body").send_keys("m")
            self.wait_for("return raystage.view.current?.header.quality === 'live'")
            before = self.js("return raystage.camera().position[0]")
            self.element("picture").send_keys(Keys.ARROW_LEFT)
            self.assertLess(self.js("return raystage.camera().position[0]"), before)
            self.screenshot("live-view")
        finally:
            recorder.terminate()
            recorder.wait(WAIT_SECONDS)
        self.assertEqual(recorder.returncode, 0)
        self.wait_for("return document.getElementById('status').textContent.includes('has ended')")
        self.leave_and_end(self.live_viewer)

    def test_held_frames_are_not_viewable(self) -> None:
        recorder = self.record("held", "--buffer-in-memory")
        try:
            self.follow("held", "return document.getElementById('status').textContent.includes('Not viewable until the flush')")
        finally:
            recorder.terminate()
            recorder.wait(WAIT_SECONDS)
        self.leave_and_end(self.live_viewer)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
