#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests the viewer's page in Chromium: keys, time, playback, and files of shots."""
import json
import math
import statistics
import sys
import unittest

from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from viewer_page import PageTest, run


# The arguments are ms a picture, and what takes the answer: [ms at which the clock started, frame that is due at the end,
# [ms, frame] of each picture that was shown].
kPlayedBySlowRenderer = """
  const [cost, done] = arguments, realNow = performance.now;
  (async () => {
    const { Playback } = await import("./playback.js");
    const canvas = document.createElement("canvas");
    const blob = await new Promise((resolve) => canvas.toBlob(resolve, "image/jpeg"));
    const jpeg = new Uint8Array(await blob.arrayBuffer());
    let now = 0, free = 0, id = 0, due = 1;
    const requests = [], pictures = [];
    performance.now = () => now;
    const playback = new Playback({
      send: (frame) => {
        free = Math.max(now, free) + cost;
        requests.push({ id: ++id, frame, ready: free });
        return id;
      },
      show: ({ frame }, bitmap) => { pictures.push([now, frame]); bitmap.close(); },
      go: (frame) => { due = frame; },
    });
    playback.start(1, () => ({ first: 1, last: 1000, fps: 10, speed: 1, loop: false }));
    for (; now < 10000; now += 10) {
      while (requests[0]?.ready <= now) {
        const { id, frame } = requests.shift();
        await playback.receive({ id, frame }, jpeg);
      }
      playback.tick(now);
    }
    const started = playback.startTime;
    playback.tick(now);
    playback.stop();
    return [started, due, pictures];
  })().then(done).finally(() => { performance.now = realNow; });
"""


class KeysAndFiles(PageTest):
    def set_key(self, frame: int, x: float) -> None:
        self.js("raystage.timeline.go(arguments[0])", frame)
        self.js("raystage.setCamera({...raystage.camera(), position: [arguments[0], 0.01, 0.02]})", x)
        self.element("set-key").click()
        self.wait_for("return !raystage.connection.waiting.size && raystage.state.shot.path.length > 0")

    def save_as(self, name: str, replace: bool = False) -> None:
        self.element("save").click()
        field = self.element("file-name")
        field.clear()
        field.send_keys(name)
        if replace:
            self.element("replace").click()
        field.send_keys(Keys.ENTER)

    def status(self) -> str:
        return self.element("status").text

    def test_keys_survive_save_and_open(self) -> None:
        self.set_key(5, 0.03)
        self.set_key(12, -0.02)
        keys = self.js("return raystage.shotText.keys()")
        self.assertEqual([key["frame"] for key in keys], [1, 5, 12])
        path = self.js("return raystage.state.shot.path.map(c => c.position[0])")
        self.assertEqual(path[4], 0.03)
        self.assertEqual(path[11], -0.02)
        self.js("raystage.shotText.change(j => { j.x_note = 'kept'; j.layers[0].comment = 'kept, too'; })")
        self.save_as("moved.json")
        self.wait_for("return document.getElementById('status').textContent === 'Saved moved.json'")
        saved = json.loads((self.root / "moved.json").read_text())
        self.assertEqual(saved["camera"]["keys"], keys)
        self.assertEqual(saved["x_note"], "kept")
        self.assertEqual(saved["layers"][0]["comment"], "kept, too")
        self.screenshot("keys-set")
        self.open_page(self.viewer.url)
        self.element("open").click()
        self.element("file-name").clear()
        self.element("file-name").send_keys("moved.json", Keys.ENTER)
        self.wait_for("return raystage.state.shot && raystage.state.shot.file === 'moved.json'")
        self.assertEqual(self.js("return raystage.shotText.keys()"), keys)
        self.assertEqual(self.js("return raystage.shotText.json.x_note"), "kept")

    def test_an_existing_file_is_replaced_only_if_confirmed(self) -> None:
        (self.root / "there.json").write_text((self.root / "take/shot.json").read_text())
        before = (self.root / "there.json").read_text()
        self.save_as("there.json")
        self.wait_for("return document.getElementById('file-error').textContent.includes('exists')")
        self.assertEqual((self.root / "there.json").read_text(), before)
        # The dialog is there again, with the name.
        self.assertEqual(self.element("file-name").get_property("value"), "there.json")
        self.element("replace").click()
        self.element("file-name").send_keys(Keys.ENTER)
        self.wait_for("return document.getElementById('status').textContent === 'Saved there.json'")
        self.assertNotEqual((self.root / "there.json").read_text(), before)
        self.save_as("../outside.json")
        self.wait_for("return document.getElementById('file-error').textContent.includes('outside')")
        self.assertFalse((self.root.parent / "outside.json").exists())
        self.element("file-name").send_keys(Keys.ESCAPE)
        self.save_as("without_extension")
        self.wait_for("return document.getElementById('status').textContent === 'Saved without_extension.json'")

    def test_a_take_is_opened_with_its_saved_shot(self) -> None:
        self.set_key(5, 0.03)
        self.save_as("take.shot.json")
        self.wait_for("return document.getElementById('status').textContent === 'Saved take.shot.json'")
        self.open_page(self.viewer.url)
        self.assertEqual(self.js("return raystage.shotText.keyAt(5).position[0]"), 0.03)
        self.assertFalse(self.js("return raystage.shotText.isChanged()"))
        # What is no shot of the take does not hide the take.
        (self.root / "take.shot.json").write_text("{")
        self.open_page(self.viewer.url)
        self.assertIsNone(self.js("return raystage.shotText.keyAt(5) ?? null"))

    def test_what_has_no_effect_is_said(self) -> None:
        self.assertEqual(self.element("focus-note").text, "The aperture has an effect with aperture only.")
        self.js("raystage.shotText.change(j => { j.layers[0].method = 'depth'; }); raystage.sendShot()")
        self.wait_for("return document.getElementById('focus-note').textContent.startsWith('depth is sharp at every depth')")
        self.js("raystage.shotText.change(j => { j.layers[0].method = 'aperture'; }); raystage.sendShot()")
        self.wait_for("return document.getElementById('focus-note').textContent === ''")

    def test_long_messages_do_not_widen_the_page(self) -> None:
        self.js("document.getElementById('status').textContent = 'what failed where and what to do. '.repeat(20)")
        self.assertLessEqual(self.js("return document.documentElement.scrollWidth"), self.js("return innerWidth"))
        box = self.js("const b = document.getElementById('snapshot').getBoundingClientRect(); return [b.left, b.right]")
        self.assertLessEqual(box[1], self.js("return innerWidth"))
        self.assertLess(self.js("return document.querySelector('header').offsetHeight"), 60)

    def test_time_follows_keys(self) -> None:
        seconds = "return raystage.state.shot.layers[0].seconds"
        last = len(self.js(seconds))
        self.assertAlmostEqual(self.js(seconds)[last - 1], 0.1 * (last - 1), delta=1e-3)
        self.js("raystage.timeline.go(8)")
        self.element("time-0").clear()
        self.element("time-0").send_keys("1.5", Keys.TAB)
        self.wait_for(seconds + "[7] === 1.5")
        self.assertEqual(self.js("return raystage.shotText.timeKeyFrames()"), [1, 8, last])
        self.screenshot("time-keys")
        self.js("raystage.timeline.go(14)")
        self.element("time-0").clear()
        self.element("time-0").send_keys("1.5", Keys.TAB)
        self.wait_for(seconds + "[13] === 1.5")
        times = self.js(seconds)
        self.assertEqual(times[7:14], [1.5] * 7, "frozen between equal keys")
        self.element("delete-time-key-0").click()
        self.wait_for(seconds + "[13] !== 1.5")
        for _ in range(3):
            self.element("undo").click()
        self.wait_for(seconds + "[7] !== 1.5")
        self.element("speed-0").clear()
        self.element("speed-0").send_keys("0.5", Keys.TAB)
        self.wait_for("return Math.abs(raystage.state.shot.layers[0].seconds[10] - 0.5) < 1e-3")

    def test_a_camera_that_follows_a_target_becomes_keys(self) -> None:
        self.js("""raystage.shotText.change((json) => {
          json.camera.keys = [{frame: 1, position: [-0.1, 0, 0], focal_length_mm: 30, target: [0, 0, -3]}, {frame: 20, position: [0.1, 0, 0]}];
        }); raystage.sendShot();""")
        self.wait_for("return raystage.state.shot.path[0].position[0] === -0.1")
        before = self.js("return raystage.state.shot.path")
        self.element("set-key").click()
        self.assertIn("Convert to keys", self.status())
        self.element("to-keys").click()
        self.wait_for("return raystage.shotText.canSetKeys() && !raystage.connection.waiting.size")
        self.assertFalse(self.element("to-keys").is_displayed())
        for old, new in zip(before, self.js("return raystage.state.shot.path")):
            for a, b in zip(old["position"] + old["orientation"], new["position"] + new["orientation"]):
                self.assertAlmostEqual(a, b, delta=6e-4)
        self.set_key(10, 0.03)
        self.assertEqual(self.js("return raystage.state.shot.path[9].position[0]"), 0.03)

    def test_a_file_opened_again_is_that_of_the_disk(self) -> None:
        self.save_as("again.json")
        self.wait_for("return document.getElementById('status').textContent === 'Saved again.json'")
        self.set_key(5, 0.03)
        self.element("open").click()
        self.element("file-name").send_keys(Keys.ENTER)
        self.wait_for("return !raystage.connection.waiting.size && !raystage.shotText.keyAt(5)")
        self.assertNotEqual(self.js("return raystage.state.shot.path[4].position[0]"), 0.03)
        self.assertTrue(self.element("recovery").is_displayed(), "the edit can be recovered")
        self.element("recover").click()
        self.wait_for("return raystage.state.shot.path[4].position[0] === 0.03")

    def test_escape_in_the_file_dialog_does_nothing(self) -> None:
        self.save_as("escape.json")
        self.wait_for("return document.getElementById('status').textContent === 'Saved escape.json'")
        self.set_key(5, 0.03)
        asked = self.js("return raystage.connection.nextId")
        for button in ("open", "save", "snapshot", "export"):
            self.element(button).click()
            self.element("file-name").send_keys(Keys.ESCAPE)
        self.assertEqual(self.js("return raystage.shotText.keyAt(5).position[0]"), 0.03)
        self.assertFalse((self.root / "frame.0005.png").exists())
        self.assertLessEqual(self.js("return raystage.connection.nextId"), asked + 2, "no request but views")

    def test_a_shot_saved_in_another_folder_finds_its_take(self) -> None:
        (self.root / "shots").mkdir(exist_ok=True)
        self.set_key(5, 0.03)
        self.save_as("shots/moved.json")
        self.wait_for("return document.getElementById('status').textContent === 'Saved shots/moved.json'")
        self.assertEqual(json.loads((self.root / "shots/moved.json").read_text())["layers"][0]["take"], "../take")
        self.assertFalse(self.js("return raystage.shotText.isChanged()"))
        self.set_key(6, 0.02)
        self.wait_for("return raystage.state.shot.file === 'shots/moved.json' && raystage.state.shot.path[5].position[0] === 0.02")
        run("render", self.root / "shots/moved.json", "--frames", "5", "-o", self.root / "moved.####.exr", "-q")

    def test_keys_hold_what_is_chosen(self) -> None:
        Select(self.element("key-what")).select_by_value("focus")
        self.js("raystage.timeline.go(9); raystage.setCamera({...raystage.camera(), position: [0.05, 0, 0], focus_m: 2.5})")
        self.element("set-key").click()
        self.wait_for("return raystage.state.shot.path[8].focus_m === 2.5")
        self.assertEqual(set(self.js("return raystage.shotText.keyAt(9)")), {"frame", "focus_m"})
        Select(self.element("key-what")).select_by_value("pose")
        self.js("raystage.setCamera({...raystage.camera(), position: [0.05, 0, 0], focal_length_mm: 90})")
        self.element("set-key").click()
        self.wait_for("return raystage.state.shot.path[8].position[0] === 0.05")
        self.assertEqual(set(self.js("return raystage.shotText.keyAt(9)")), {"frame", "focus_m", "position", "orientation"})
        Select(self.element("key-what")).select_by_value("all")

    def test_keys_are_moved_and_deleted(self) -> None:
        self.set_key(5, 0.03)
        steps = self.js("return raystage.shotText.past.length")
        box = "const c = document.getElementById('timeline'), b = c.getBoundingClientRect(), t = raystage.timeline;"
        drag = box + """c.setPointerCapture = () => {};
          const send = (type, frame) => c.dispatchEvent(new PointerEvent(type, {bubbles: true, clientX: b.left + t.x(frame), clientY: b.bottom - 8, pointerId: 1}));
          send('pointerdown', 5); for (const frame of [6, 7, 8, 9]) send('pointermove', frame); send('pointerup', 9);"""
        self.js(drag)
        self.assertEqual([key["frame"] for key in self.js("return raystage.shotText.keys()")], [1, 9])
        self.assertEqual(self.js("return raystage.shotText.past.length"), steps + 1, "one step to undo")
        self.js("raystage.timeline.go(9)")
        self.body().send_keys(Keys.CONTROL + Keys.ARROW_RIGHT + Keys.NULL)
        self.assertEqual([key["frame"] for key in self.js("return raystage.shotText.keys()")], [1, 10])
        self.assertEqual(self.js("return raystage.timeline.frame"), 10)
        self.element("delete-key").click()
        self.wait_for("return raystage.shotText.keys().length === 1 && !raystage.connection.waiting.size")
        self.assertTrue(self.element("delete-key").get_property("disabled"))

    def test_in_out_loop_and_reverse(self) -> None:
        self.js("""raystage.timeline.go(3); document.getElementById('set-in').click();
          raystage.timeline.go(8); document.getElementById('set-out').click(); raystage.timeline.go(1);
          document.getElementById('loop').click(); globalThis.frames = [];
          const changed = raystage.timeline.changed; raystage.timeline.changed = (frame, quality) => { frames.push(frame); changed(frame, quality); };""")
        self.element("play").click()
        self.wait_for("return !raystage.timeline.playing")
        frames = self.js("return frames")
        self.assertEqual(frames, sorted(frames))
        self.assertLessEqual(set(frames), set(range(3, 9)), "begins at the start of the loop, ends at its end")
        self.assertEqual(frames[-1], 8)
        Select(self.element("speed")).select_by_value("-1")
        self.js("frames = []")
        self.element("play").click()
        self.wait_for("return !raystage.timeline.playing")
        frames = self.js("return frames")
        self.assertEqual(frames, sorted(frames, reverse=True))
        self.assertEqual(frames[-1], 3)
        for button, frame in (("first", 3), ("last", 8), ("back", 7), ("forward", 8)):
            self.element(button).click()
            self.assertEqual(self.js("return raystage.timeline.frame"), frame, button)

    def test_a_lost_connection_is_made_again(self) -> None:
        self.set_key(5, 0.03)
        self.js("raystage.connection.socket.close()")
        self.wait_for("return document.getElementById('status').textContent.includes('lost')")
        self.wait_for("return raystage.connection.socket.readyState === 1 && !raystage.connection.waiting.size")
        self.js("raystage.timeline.go(7)")
        self.wait_for("return raystage.state.picture.frame === 7 && raystage.state.picture.final")
        self.assertEqual(self.js("return raystage.shotText.keyAt(5).position[0]"), 0.03)

    def test_a_request_that_is_wrong_is_answered(self) -> None:
        answer = self.js("return raystage.connection.ask('focus', {frame: 1, width: 9, height: 9}).then(() => '', (error) => error.message)")
        self.assertIn("pixel", answer)
        self.assertEqual(self.js("return raystage.connection.waiting.size"), 0)

    def test_undo_and_redo(self) -> None:
        self.set_key(5, 0.03)
        self.set_key(5, 0.04)
        position = "return raystage.shotText.keyAt(5)?.position[0] ?? null"
        self.element("undo").click()
        self.assertEqual(self.js(position), 0.03)
        self.element("undo").click()
        self.assertIsNone(self.js(position))
        self.element("redo").click()
        self.element("redo").click()
        self.assertEqual(self.js(position), 0.04)
        self.wait_for("return raystage.state.shot.path[4].position[0] === 0.04")

    def test_a_snapshot_is_what_render_and_preview_write(self) -> None:
        self.set_key(1, 0.015)
        for method in ("focal_plane", "depth"):
            Select(self.element("method-0")).select_by_value(method)
            self.wait_for("return raystage.state.shot.layers[0].method === arguments[0]", method)
            self.save_as(f"{method}.json")
            self.wait_for("return document.getElementById('status').textContent === arguments[0]", f"Saved {method}.json")
            self.element("snapshot").click()
            self.element("file-name").clear()
            self.element("file-name").send_keys(f"{method}.png", Keys.ENTER)
            self.wait_for("return document.getElementById('status').textContent === arguments[0]", f"Written {method}.png")
            run("render", self.root / f"{method}.json", "--frames", "1", "-o", self.root / f"{method}.####.exr", "-q")
            run("preview", self.root / f"{method}.####.exr", "-o", self.root / f"{method}-rendered.####.png", "-q")
            rendered = next(self.root.glob(f"{method}-rendered.*.png"))
            self.assertEqual((self.root / f"{method}.png").read_bytes(), rendered.read_bytes(), method)

    def test_plays_at_true_speed(self) -> None:
        self.refined()
        self.js("raystage.timeline.loop = true; document.getElementById('play').click()")
        self.wait_for("return raystage.playback.startTime && performance.now() - raystage.playback.startTime > 2000")
        # In an animation frame, after the playback's own part of it.
        wanted, elapsed = self.browser.execute_async_script("""
          const done = arguments[0];
          requestAnimationFrame(() => done([raystage.playback.statistics.wanted, (performance.now() - raystage.playback.startTime) / 1000]))""")
        self.assertAlmostEqual(wanted, elapsed * 10, delta=2)
        self.wait_for("return raystage.playback.statistics.shown > 3")  # frames may be dropped, but not all
        self.js("raystage.timeline.go(3)")  # goes on from there
        self.wait_for("return raystage.timeline.frame > 5 && raystage.timeline.frame < 12")
        self.element("play").click()

    def test_pictures_are_shown_in_time_however_slow_they_are(self) -> None:
        """Plays 10 frames a second for 10 s of a clock of this test, from a renderer that takes a given time a picture."""
        for cost in (20, 90, 250, 900):
            started, due, pictures = self.browser.execute_async_script(kPlayedBySlowRenderer, cost)
            possible = (10000 - started) / max(cost, 100)
            self.assertEqual(due, 1 + math.floor((10000 - started) / 100), "playing is never slower")
            late = [(now - started) / 100 + 1 - frame for now, frame in pictures]
            self.assertGreaterEqual(min(late), 0, "no picture is shown before its time")
            # Of a renderer that is too slow, the first pictures are late, by its time for one.
            too_slow = cost / 100 if cost > 100 else 0
            self.assertLess(max(late), 2 + too_slow, f"{cost} ms a picture")
            self.assertLess(statistics.mean(late), 0.2 + too_slow / 2, f"{cost} ms a picture")
            self.assertGreater(len(pictures), 0.8 * possible, f"{cost} ms a picture")


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
