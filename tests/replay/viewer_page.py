# SPDX-License-Identifier: Apache-2.0
"""A small take, a viewer of it, and a real Chromium, for tests of the viewer's page."""
import json
import os
import pathlib
import re
import subprocess
import tempfile
import time
import unittest

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BIN = pathlib.Path(os.environ.get("RAYSTAGE_BIN_DIR", ROOT / "build/check/bin"))
WAIT_SECONDS = 60  # a busy machine is no fault


def run(*command: str) -> None:
    subprocess.run([str(BIN / "raystage"), *map(str, command)], check=True, capture_output=True)


def simulate(folder: pathlib.Path, *options: str) -> None:
    run("simulate", "still", "-q", "--rows", "3", "--columns", "3", "--width", "160", "--height", "120", "--fps", "10",
        "--seconds", "2", "--truth-views", "0", "-o", folder, *options)
    run("sync", "-q", folder)


class Viewer:
    """`raystage replay` as a process."""

    def __init__(self, target: pathlib.Path, *options: str) -> None:
        self.process = subprocess.Popen([str(BIN / "raystage"), "replay", str(target), *options],
                                        stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        self.url = re.fullmatch(r"Open (http://\S+)\n", line).group(1)

    def end(self) -> int:
        self.process.terminate()
        code = self.process.wait(timeout=WAIT_SECONDS)
        self.process.stdout.close()
        return code


def start_browser(width: int = 1280, height: int = 720, unlimited: bool = False) -> webdriver.Chrome:
    """`unlimited`: animation frames as fast as they are drawn, and not at 60 Hz."""
    options = Options()
    options.binary_location = "/usr/bin/chromium"
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu",
                     f"--window-size={width},{height}", "--hide-scrollbars", "--force-device-scale-factor=1"):
        options.add_argument(argument)
    if unlimited:
        options.add_argument("--disable-frame-rate-limit")
        options.add_argument("--disable-gpu-vsync")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)


class PageTest(unittest.TestCase):
    """Tests with one take, one viewer and one browser for the class."""

    SIZE = (1280, 720)
    TAKE = ()  # options of the take's simulation

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory(prefix="raystage-replay-")
        cls.root = pathlib.Path(cls.folder.name)
        simulate(cls.root / "take", *cls.TAKE)
        cls.viewer = Viewer(cls.root / "take")
        cls.browser = start_browser(*cls.SIZE)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.browser.quit()
        assert cls.viewer.end() == 0
        cls.folder.cleanup()

    def setUp(self) -> None:
        (self.root / "take.shot.json").unlink(missing_ok=True)  # a saved shot is shown again
        self.open_page(self.viewer.url)
        # What a test before left unsaved is kept, on a slow machine even after its page was left.
        if self.element("recovery").is_displayed():
            self.element("discard").click()
            self.wait_for("return !raystage.connection.waiting.size")

    def tearDown(self) -> None:
        errors = [entry for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]
        self.assertEqual(errors, [], "the page has errors")

    def open_page(self, url: str) -> None:
        self.browser.get(url)
        self.wait_for("return raystage.state.picture && raystage.state.picture.final")

    def leave_and_end(self, viewer: Viewer) -> None:
        """Ends a viewer after its page is left, because a page whose connection is lost tries to connect again."""
        self.browser.get("about:blank")
        self.assertEqual(viewer.end(), 0)

    def js(self, script: str, *arguments):
        return self.browser.execute_script(script, *arguments)

    def wait_for(self, script: str, *arguments):
        return WebDriverWait(self.browser, WAIT_SECONDS, poll_frequency=0.02).until(
            lambda _: self.js(script, *arguments), f"never true: {script}")

    def element(self, name: str):
        return self.browser.find_element("id", name)

    def refined(self) -> dict:
        """Waits for a refined picture of the present view and returns its header."""
        self.wait_for("return !raystage.view.wanted && raystage.view.underWay.size === 0 && !raystage.view.next"
                      " && raystage.state.picture.quality === 'resting'")
        return self.js("return raystage.state.picture")

    def pixels(self) -> list:
        """Returns the picture as it is shown, 32 x 24 mean colours, to compare views."""
        self.refined()
        return self.js("""
          const small = document.createElement('canvas');
          small.width = 32; small.height = 24;
          const context = small.getContext('2d');
          context.drawImage(document.getElementById('picture'), 0, 0, 32, 24);
          return [...context.getImageData(0, 0, 32, 24).data]""")

    def difference(self, a: list, b: list) -> float:
        return sum(abs(x - y) for x, y in zip(a, b)) / len(a)

    def screenshot(self, name: str) -> None:
        folder = os.environ.get("RAYSTAGE_SCREENSHOTS")
        if folder:
            pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
            self.browser.save_screenshot(str(pathlib.Path(folder) / f"{name}.png"))

    def body(self):
        """The element that has the keyboard."""
        return self.browser.switch_to.active_element

    def camera(self) -> dict:
        return self.js("return raystage.camera()")
