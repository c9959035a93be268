#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests the viewer's page in Chromium: every control changes the picture as it should."""
import json
import math
import sys
import unittest

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from viewer_page import PageTest


def distance(a, b) -> float:
    return math.dist(a, b)


class Flying(PageTest):
    def drag(self, x: int, y: int, key: str = "") -> None:
        actions = ActionChains(self.browser, duration=20)
        if key:
            actions.key_down(key)
        actions.move_to_element(self.element("picture")).click_and_hold()
        for _ in range(5):
            actions.move_by_offset(x // 5, y // 5)
        actions.release()
        if key:
            actions.key_up(key)
        actions.perform()

    def focus_point(self) -> list:
        return self.js("return import('./camera.js').then(cam => cam.focusPoint(raystage.camera()))")

    def test_shows_the_take(self) -> None:
        header = self.refined()
        self.assertEqual(header["frame"], 1)
        self.assertLess(header["uncovered"], 0.2)
        self.assertEqual(self.element("title").text, "simulated still")
        self.assertGreater(len(set(self.pixels())), 50, "the picture shows something")
        self.screenshot("take")

    def test_the_map_draws_the_range_of_motion(self) -> None:
        self.refined()
        (wide,) = self.js("return raystage.state.ranges")
        self.assertEqual(wide["layer"], 0)
        self.js("raystage.setCamera({ ...raystage.camera(), focal_length_mm: 2.5 * raystage.camera().focal_length_mm })")
        self.refined()
        (narrow,) = self.js("return raystage.state.ranges")
        extent = lambda found: [max(v[i] for v in found["vertices"]) - min(v[i] for v in found["vertices"]) for i in range(3)]
        self.assertGreater(extent(narrow)[2], 0.1, "it is as deep as the array is wide, over twice the tangent")
        if wide["vertices"]:
            self.assertGreater(extent(narrow)[2], 1.5 * extent(wide)[2])
        # Afterwards those of all, 99 and 90 % of the rays, as the cameras see them.
        self.wait_for("return raystage.state.nested && raystage.state.nested.view.includes(raystage.camera().focal_length_mm)")
        nested = self.js("return raystage.state.nested.ranges")
        self.assertEqual([one["share"] for one in nested], [1, 0.99, 0.9])
        depths = [extent(one)[2] for one in nested]
        self.assertEqual(depths, sorted(depths))
        self.assertGreater(depths[2], 1.02 * depths[0])
        for axis in range(3):
            self.assertGreater(extent(nested[0])[axis], 0.97 * extent(narrow)[axis], "it contains the simple one")
        green = """const c = document.getElementById('map'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
          let n = 0; for (let i = 0; i < d.length; i += 4) n += d[i + 1] > d[i] + 8 && d[i + 1] > d[i + 2] + 4; return n"""
        self.assertGreater(self.js(green), 200)
        self.screenshot("range of motion")

    def test_the_map_draws_the_range_of_a_subject(self) -> None:
        self.refined()
        self.element("subject-at-focus").click()
        self.wait_for("return raystage.state.subjectRanges.length === 1 && raystage.state.subjectRanges[0].vertices.length > 0")
        subject = self.js("return raystage.state.subject")
        self.assertLess(distance(subject["point"], self.focus_point()), 1e-6)
        self.assertEqual(self.element("subject-size").get_attribute("value"), "0.5")
        depth = lambda: max(v[2] for v in self.js("return raystage.state.subjectRanges[0].vertices"))
        wide = depth()
        violet = """const c = document.getElementById('map'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
          let n = 0; for (let i = 0; i < d.length; i += 4) n += d[i + 2] > d[i + 1] + 10 && d[i] > d[i + 1] + 4; return n"""
        self.assertGreater(self.js(violet), 100)
        self.screenshot("range of a subject")
        # A larger subject is seen from fewer places, and one that is not in front of the array from none.
        self.js("const f = document.getElementById('subject-size'); f.value = 1.2; f.dispatchEvent(new Event('change'))")
        self.wait_for("return raystage.state.subjectRanges.length === 1")
        self.assertLess(depth(), wide)
        self.js("const f = document.getElementById('subject-size'); f.value = 1000; f.dispatchEvent(new Event('change'))")
        self.wait_for("return document.getElementById('subject-note').textContent.includes('not in front')")
        self.js("const f = document.getElementById('subject-size'); f.value = 0; f.dispatchEvent(new Event('change'))")
        self.refined()
        self.assertEqual(self.js(violet), 0)
        self.assertEqual(self.element("subject-note").text, "")

    def test_dragging_orbits_about_the_focus_point(self) -> None:
        before, seen, point = self.camera(), self.pixels(), self.focus_point()
        self.drag(50, 0)
        after = self.camera()
        self.assertLess(after["position"][0], before["position"][0])
        self.assertLess(distance(self.focus_point(), point), 1e-6)
        self.assertGreater(self.difference(self.pixels(), seen), 1)
        self.drag(0, 50)
        self.assertGreater(self.camera()["position"][1], after["position"][1])

    def test_shift_and_drag_pans(self) -> None:
        before, seen = self.camera(), self.pixels()
        self.drag(20, 0, Keys.SHIFT)
        after = self.camera()
        self.assertLess(after["position"][0], before["position"][0])
        self.assertEqual(after["orientation"], before["orientation"])
        self.assertGreater(self.difference(self.pixels(), seen), 1)

    def test_the_wheel_dollies_and_keeps_the_focal_plane(self) -> None:
        before, point = self.camera(), self.focus_point()
        ActionChains(self.browser).scroll_from_origin(
            ScrollOrigin.from_element(self.element("picture")), 0, -100).perform()
        self.refined()
        after = self.camera()
        self.assertLess(after["position"][2], before["position"][2])
        self.assertLess(distance(self.focus_point(), point), 1e-6)

    def test_fields_set_the_camera(self) -> None:
        for name, value in [("position-x", "0.05"), ("position-y", "-0.02"), ("position-z", "0.1"), ("fov", "30"),
                            ("azimuth", "4"), ("elevation", "-3"), ("roll", "10"), ("focal-length", "60")]:
            seen = self.pixels()
            field = self.element(name)
            field.clear()
            field.send_keys(value, Keys.TAB)
            self.assertGreater(self.difference(self.pixels(), seen), 0.3, name)
            self.assertAlmostEqual(float(field.get_attribute("value")), float(value), 2, name)
        angles = self.js("return import('./camera.js').then(cam => cam.angles(raystage.camera()))")
        self.assertAlmostEqual(angles["azimuth"], 4, 6)
        self.assertAlmostEqual(angles["elevation"], -3, 6)
        self.assertAlmostEqual(angles["roll"], 10, 6)

    def enter(self, name: str, value: str) -> str:
        """Enters a value in a field and returns what the field shows then."""
        field = self.element(name)
        field.clear()
        field.send_keys(value, Keys.TAB)
        return field.get_attribute("value")

    def test_values_out_of_range_are_said(self) -> None:
        for name, value, kept, text in [("fov", "400", "179", "FOV is 0.1 to 179 deg."), ("focus", "-3", "0.01", "Distance is 0.01 to 1000000 m."),
                                        ("position-x", "1e9", "1000000", "x is -1000000 to 1000000 m.")]:
            self.assertEqual(float(self.enter(name, value)), float(kept), name)
            self.assertEqual(self.element("status").text, text)

    def test_the_shot_has_fields(self) -> None:
        self.js("document.getElementById('shot-name').closest('details').open = true")
        self.enter("shot-name", "a <b>name</b>")
        self.enter("shot-width", "320")
        self.enter("shot-height", "100")
        self.enter("shot-fps", "24000/1001")
        self.enter("shot-last-frame", "7")
        self.enter("shot-first-frame", "9")
        self.wait_for("return raystage.state.shot.first_frame === 9 && raystage.state.shot.last_frame === 9")
        shot = json.loads(self.js("return raystage.shotText.text()"))
        self.assertEqual([shot["name"], shot["width"], shot["height"], shot["fps"], shot["first_frame"], shot["last_frame"]],
                         ["a <b>name</b>", 320, 100, "24000/1001", 9, 9])
        self.assertEqual(self.element("title").text, "a <b>name</b>")
        self.assertAlmostEqual(self.js("return raystage.view.width / raystage.view.height"), 3.2, 1)
        self.assertEqual(self.enter("shot-fps", "many"), "24000/1001")
        self.assertIn("24000/1001", self.element("status").text)
        self.assertEqual(self.enter("shot-width", "0"), "1")
        self.assertEqual(self.element("status").text, "Width is 1 to 65535 pixels.")
        for _ in range(7):
            self.js("document.getElementById('undo').click()")
        self.wait_for("return raystage.state.shot.width !== 320 && raystage.state.shot.last_frame > 9")

    def test_rolling_does_not_move_the_camera(self) -> None:
        before = self.camera()["position"]
        for _ in range(9):
            self.element("picture").send_keys("q")
        self.assertEqual(self.camera()["position"], before)
        self.element("picture").send_keys("]", Keys.HOME)
        self.assertIn("focus is that of the shot", self.element("status").text)

    def test_the_keyboard_alone_suffices(self) -> None:
        self.element("picture").send_keys("")
        for keys, index, sign in [(Keys.ARROW_LEFT, 0, -1), (Keys.ARROW_RIGHT, 0, 1), (Keys.ARROW_UP, 1, 1),
                                  (Keys.ARROW_DOWN, 1, -1), (Keys.PAGE_UP, 2, -1), (Keys.PAGE_DOWN, 2, 1)]:
            before = self.camera()["position"][index]
            self.element("picture").send_keys(keys)
            self.assertGreater((self.camera()["position"][index] - before) * sign, 1e-4, repr(keys))
        focus = self.camera()["focus_m"]
        self.element("picture").send_keys("]")
        self.assertGreater(self.camera()["focus_m"], focus)
        self.element("picture").send_keys(".")
        self.assertEqual(self.js("return raystage.timeline.frame"), 2)
        self.element("picture").send_keys("k")
        self.wait_for("return raystage.shotText.keys().length === 2")
        self.element("picture").send_keys(Keys.HOME, "?")
        self.wait_for("return document.getElementById('help-dialog').open")
        self.screenshot("keys")
        self.element("help-dialog").send_keys(Keys.ESCAPE)


class Focusing(PageTest):
    def click(self, x: float, y: float) -> float:
        """Clicks at a share of the picture and returns the distance in focus."""
        size = self.element("picture").size
        self.js("raystage.state.focusMs = null")
        ActionChains(self.browser).move_to_element_with_offset(
            self.element("picture"), int((x - 0.5) * size["width"]), int((y - 0.5) * size["height"])).click().perform()
        self.wait_for("return raystage.state.focusMs")
        return self.camera()["focus_m"]

    def test_clicks_focus_on_what_is_there(self) -> None:
        near, far = self.click(0.5, 0.62), self.click(0.395, 0.43)
        self.assertLess(near, far)
        # By the depths of the method depth, at the same pixels.
        depth = self.js("""
          const ask = (pixel) => raystage.connection.ask('probe', {frame: 1, width: raystage.view.width,
            height: raystage.view.height, pixel, camera: {...raystage.camera(), focus_m: undefined}});
          raystage.shotText.change(json => { json.layers[0].method = 'depth'; });
          return raystage.connection.ask('shot', {file: raystage.shotText.file, text: raystage.shotText.text()})
            .then(async () => {
              const found = [];
              for (const [x, y] of [[0.5, 0.62], [0.395, 0.43]]) {
                found.push((await ask([x * raystage.view.width, y * raystage.view.height])).z);
              }
              return found;
            })""")
        self.assertAlmostEqual(near, depth[0], delta=0.1 * depth[0])
        self.assertAlmostEqual(far, depth[1], delta=0.1 * depth[1])

    def test_the_slider_is_in_dioptres(self) -> None:
        seen = self.pixels()
        self.js("""const slider = document.getElementById('focus-slider');
          slider.value = 0.5; slider.dispatchEvent(new Event('input', {bubbles: true}))""")
        self.assertAlmostEqual(self.camera()["focus_m"], 2, 6)
        self.assertGreater(self.difference(self.pixels(), seen), 0.3)

    def test_peaking_marks_what_is_sharp(self) -> None:
        red = """const c = document.getElementById('picture'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
          let n = 0; for (let i = 0; i < d.length; i += 4) n += d[i] > 200 && d[i + 1] < 90 && d[i + 2] < 90; return n"""
        self.refined()
        before = self.js(red)
        self.element("peaking").click()
        self.refined()
        self.assertGreater(self.js(red), before + 100)
        self.screenshot("peaking")

    def test_the_aperture_changes_the_depth_of_field(self) -> None:
        Select(self.element("method-0")).select_by_value("aperture")
        self.wait_for("return raystage.state.shot.layers[0].method === 'aperture'")
        seen = self.pixels()
        field = self.element("f-number")
        field.send_keys("0.2", Keys.TAB)
        self.assertGreater(self.difference(self.pixels(), seen), 0.1)


class Looking(PageTest):
    def choose(self, name: str, value: str) -> list:
        Select(self.element(name)).select_by_value(value)
        return self.pixels()

    def test_channels_exposure_display_and_background(self) -> None:
        color = self.pixels()
        seen = {"color": color}
        for channel in ("alpha", "depth", "coverage"):
            seen[channel] = self.choose("channel", channel)
            self.assertEqual(self.element("legend").is_displayed(), channel == "depth")
            if channel == "depth":
                self.assertRegex(self.element("legend").text, r"^([0-9.]+ m|infinity)\s+[0-9.]+ m$")
            self.screenshot("channel-" + channel)
        self.assertGreater(self.difference(seen["depth"], color), 5)
        self.assertGreater(self.difference(seen["alpha"], color), 5)
        self.assertLess(self.difference(self.choose("channel", "color"), color), 0.01)
        self.element("exposure").clear()
        self.element("exposure").send_keys("2", Keys.TAB)
        self.assertGreater(sum(self.pixels()), sum(color) * 1.2)
        self.element("exposure").clear()
        self.element("exposure").send_keys("0", Keys.TAB)
        self.assertGreater(self.difference(self.choose("display", "sRGB|ACES 1.0 SDR"), color), 2)
        self.choose("display", "|")
        self.element("azimuth").clear()
        self.element("azimuth").send_keys("40", Keys.TAB)  # beyond what the array saw
        checker = self.pixels()
        self.assertGreater(self.js("return raystage.state.picture.uncovered"), 0.1)
        self.element("black").click()
        self.assertGreater(self.difference(self.pixels(), checker), 2)

    def test_guides_are_drawn(self) -> None:
        drawn = """const c = document.getElementById('guides');
          return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(v => v > 0)"""
        self.assertFalse(self.js(drawn))
        for kind in ("thirds", "safe", "overscan"):
            Select(self.element("guides-kind")).select_by_value(kind)
            self.assertTrue(self.js(drawn), kind)

    def test_every_method_shows_a_picture(self) -> None:
        for method in ("nearest", "lumigraph", "slabs", "plane_sweep", "depth", "focal_plane"):
            Select(self.element("method-0")).select_by_value(method)
            self.wait_for("return raystage.state.shot.layers[0].method === arguments[0]", method)
            header = self.refined()
            self.wait_for("return raystage.state.picture.final")
            self.assertLess(header["uncovered"], 0.3, method)
            self.assertNotEqual(self.element("method-summary").text, "")


class HostileNames(PageTest):
    def test_markup_in_documents_is_text(self) -> None:
        markup = "<img src=x onerror='document.title=1'><script>document.title=2</script>"
        shot = json.loads(self.js("return raystage.shotText.text()"))
        shot["name"] = markup
        shot["layers"][0]["name"] = markup
        (self.root / "hostile.json").write_text(json.dumps(shot))
        self.element("open").click()
        self.element("file-name").clear()
        self.element("file-name").send_keys("hostile.json", Keys.ENTER)
        self.wait_for("return raystage.state.shot?.file === 'hostile.json'")
        self.refined()
        self.assertEqual(self.element("title").text, markup)
        self.assertIn(markup, self.element("layers").text)
        self.assertEqual(self.js("return document.querySelectorAll('img').length"), 0)

    def test_errors_say_where_and_what_to_do(self) -> None:
        (self.root / "wrong.json").write_text('{"schema": "raystage/shot/2", "name": 3}')
        for file, expected in [("wrong.json", "wrong.json#"), ("missing.json", "missing.json")]:
            self.js("raystage.connection.ask('open', {file: arguments[0]}).catch(() => {})", file)
            self.wait_for("return document.getElementById('status').textContent.includes(arguments[0])", expected)
        self.assertIsNotNone(self.js("return raystage.state.shot"), "the shot before is still shown")
        self.refined()


class LargeWindow(PageTest):
    SIZE = (3840, 2160)

    def test_the_picture_has_the_pixels_of_the_screen(self) -> None:
        header = self.refined()
        self.assertGreater(header["height"], 1800)
        self.assertAlmostEqual(header["width"] / header["height"], 4 / 3, 2)
        self.screenshot("large")


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
