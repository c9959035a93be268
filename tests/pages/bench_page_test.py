#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The page of `raystage bench` in a real Chromium: crops flip between truth and settings."""
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "replay"))
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402
from viewer_page import run, start_browser  # noqa: E402

HOSTILE = "<img src=x onerror='document.title=1'>\"<script>document.title=2</script>"
NAMES = ["truth", "focal_plane", HOSTILE, "plane_sweep"]


class BenchPage(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory(prefix="raystage-pages-")
        root = pathlib.Path(cls.folder.name)
        run("simulate", "still", "-q", "--rows", "3", "--columns", "3", "--width", "160", "--height", "120", "--seconds", "0.6",
            "--truth-width", "312", "--truth-height", "208", "--truth-views", "2", "-o", root / "take")
        run("sync", "-q", root / "take")
        run("bench", root / "take", root / "take/views.json", "-q", "--repeat", "1", "--crops", "5", "-o", root / "out", "--setting",
            "focal_plane", "--setting", HOSTILE + ":nearest", "--setting", "plane_sweep")
        cls.url = (root / "out/trade.html").as_uri()
        cls.browser = start_browser(1280, 900)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.browser.quit()
        cls.folder.cleanup()

    def setUp(self) -> None:
        self.browser.get(self.url)

    def tearDown(self) -> None:
        self.assertEqual(self.browser.get_log("browser"), [], "no error, nothing that the policy blocks")

    def elements(self, selector: str) -> list:
        return self.browser.find_elements(By.CSS_SELECTOR, selector)

    def shown(self) -> set:
        """Returns what the crops show, which is the same for all."""
        crops = self.elements("#crops .strip")
        self.assertEqual(len(crops), 5)
        images = [image for image in self.elements("#crops .strip img") if image.is_displayed()]
        self.assertEqual(len(images), len(crops), "one picture in each")
        names = {image.get_attribute("alt") for image in images}
        self.assertEqual(len(names), 1)
        return names.pop()

    def test_a_click_flips_a_crop_in_its_place(self) -> None:
        crop = self.elements("#crops .strip")[1]
        place = "const i = [...arguments[0].querySelectorAll('img')].find(i => i.offsetParent); const b = i.getBoundingClientRect();"
        box = place + "return [b.left + scrollX, b.top + scrollY, b.width, b.height]"
        pixels = place + "return i.src"
        self.assertEqual(self.shown(), "focal_plane")
        crop.click()
        before = self.browser.execute_script(box, crop), self.browser.execute_script(pixels, crop)
        self.assertEqual(self.shown(), "truth")
        crop.click()
        after = self.browser.execute_script(box, crop), self.browser.execute_script(pixels, crop)
        self.assertEqual(self.shown(), "focal_plane")
        self.assertEqual(before[0], after[0], "the same box")
        self.assertEqual(before[0][2:], [288, 288], "three times as large")
        self.assertNotEqual(before[1], after[1], "other pixels")
        self.assertEqual(self.browser.execute_script("return getComputedStyle(document.querySelector('.strip img')).imageRendering"), "pixelated")

    def test_names_show_their_pictures(self) -> None:
        names = self.elements("#crops .names button")
        self.assertEqual([name.text for name in names], NAMES)
        ActionChains(self.browser).move_to_element(names[3]).perform()
        self.assertEqual(self.shown(), "plane_sweep")
        ActionChains(self.browser).move_to_element(self.elements("#crops h2")[0]).perform()
        self.assertEqual(self.shown(), "focal_plane", "hovering does not choose")
        names[2].click()
        ActionChains(self.browser).move_to_element(self.elements("#crops h2")[0]).perform()
        self.assertEqual(self.shown(), HOSTILE)
        self.assertEqual([name.get_attribute("aria-pressed") for name in names], ["false", "false", "true", "false"])

    def test_keys_flip_where_the_focus_is(self) -> None:
        crop = self.elements("#crops .strip")[0]
        pictures = self.elements("#setting")[0]
        crop.send_keys(Keys.ARROW_RIGHT)
        self.assertEqual(self.shown(), HOSTILE)
        self.assertIn(HOSTILE, crop.get_attribute("aria-label"))
        for key in (" ", "t", Keys.ENTER):
            crop.send_keys(key)
            self.assertEqual(self.shown(), "truth")
            crop.send_keys(key)
            self.assertEqual(self.shown(), HOSTILE)
        crop.send_keys(Keys.ARROW_LEFT, Keys.ARROW_LEFT, Keys.ARROW_LEFT)
        self.assertEqual(self.shown(), "plane_sweep", "around the end")
        self.assertEqual(pictures.get_attribute("value"), "0", "the pictures below stay")
        self.elements("#crops .names button")[0].send_keys(" ")
        self.assertEqual(self.shown(), "truth")
        self.elements("#truth")[0].send_keys(Keys.ARROW_RIGHT)
        self.assertEqual(pictures.get_attribute("value"), "1")
        self.assertEqual(self.shown(), "truth", "the crops stay")

    def test_tells_where_the_crops_are(self) -> None:
        headings = [heading.text for heading in self.elements("#crops h3")]
        self.assertEqual(len(set(headings)), 5)
        for heading, reason in zip(headings, ["Settings differ most", "Even the best is wrong", "Edges of depth", "Thin structures"]):
            self.assertRegex(heading, rf"^{reason}\nview00\d, pixel \d+, \d+$")

    def test_the_table_has_regions_and_marks_the_best(self) -> None:
        headings = [heading.text for heading in self.elements(".quality th")]
        for column in ("PSNR dB", "edges MS-SSIM", "thin dB", "bad 0.5 px %", "planes px RMS", "alpha error"):
            self.assertIn(column, headings)
        psnr = {row.find_elements(By.TAG_NAME, "td")[0].text: row.find_elements(By.TAG_NAME, "td")[1] for row in
                self.elements(".quality tbody tr")}
        self.assertEqual(list(psnr), NAMES[1:])
        best = max(psnr, key=lambda name: float(psnr[name].text))
        self.assertEqual([name for name in psnr if psnr[name].get_attribute("class") == "best"], [best])

    def test_markup_in_labels_is_text(self) -> None:
        self.assertEqual(self.browser.title, "simulated still: speed against accuracy")
        self.assertEqual(self.elements("img[src=x]"), [])

    def test_is_dark_or_light_as_the_system(self) -> None:
        colours = {}
        for scheme in ("dark", "light"):
            self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
            colours[scheme] = [self.browser.execute_script(
                "return getComputedStyle(document.querySelector(arguments[0]))[arguments[1]].match(/\\d+/g).map(Number)", *what)
                for what in [("#crops .names", "backgroundColor"), ("#crops h3", "color")]]
        self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
        self.assertLess(sum(colours["dark"][0]) + 300, sum(colours["dark"][1]))
        self.assertGreater(sum(colours["light"][0]), sum(colours["light"][1]) + 300)

    def test_without_scripts_the_pictures_are_side_by_side(self) -> None:
        self.browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
        try:
            self.browser.get(self.url)
            figures = self.elements("#crops .place:first-child figure")
            self.assertEqual([figure.find_element(By.TAG_NAME, "img").get_attribute("alt") for figure in figures], NAMES)
            self.assertEqual(len({figure.rect["y"] for figure in figures}), 1, "in a row")
            self.assertEqual(len({figure.rect["x"] for figure in figures}), 4)
            self.assertFalse(self.elements("#crops .names")[0].is_displayed(), "buttons would do nothing")
        finally:
            self.browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})

    def test_fits_a_narrow_window(self) -> None:
        self.browser.set_window_size(600, 900)
        try:
            self.assertEqual(self.shown(), "focal_plane")
            width = self.browser.execute_script("return document.documentElement.scrollWidth - innerWidth")
            self.assertLessEqual(width, 0, "only tables scroll sideways")
        finally:
            self.browser.set_window_size(1280, 900)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
