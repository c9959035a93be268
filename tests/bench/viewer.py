#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures the viewer in Chromium on this machine, which the browser shares: displayed pictures per second and the time
from a pointer event to the animation frame that shows its picture, while the camera is dragged; refinement; start.

Usage: viewer.py TAKE [PROGRAMS_FOLDER]      (default: build/release/bin)
"""
import os
import pathlib
import statistics
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
os.environ["RAYSTAGE_BIN_DIR"] = sys.argv[2] if len(sys.argv) > 2 else str(ROOT / "build/release/bin")
sys.path.insert(0, str(ROOT / "tests/replay"))
from selenium.webdriver.support.ui import WebDriverWait  # noqa: E402
from viewer_page import Viewer, start_browser  # noqa: E402

# Pointer events as a mouse of 125 Hz sends them, in a circle.
DRAG = """
const [seconds, done] = arguments;
const canvas = document.getElementById('picture'), box = canvas.getBoundingClientRect();
const x0 = box.left + box.width / 2, y0 = box.top + box.height / 2, start = performance.now();
const send = (type, x, y) => canvas.dispatchEvent(new PointerEvent(type, {bubbles: true, clientX: x, clientY: y, buttons: 1, pointerId: 1}));
canvas.setPointerCapture = () => {};
raystage.view.statistics = {shown: [], latency: []};
send('pointerdown', x0, y0);
const timer = setInterval(() => {
  const t = (performance.now() - start) / 1000;
  if (t < seconds) return send('pointermove', x0 + 60 * Math.sin(2 * t), y0 + 40 * (1 - Math.cos(2 * t)));
  clearInterval(timer);
  send('pointerup', x0, y0);
  done({seconds: t, ...raystage.view.statistics, header: raystage.state.picture});
}, 8);
"""


def percentile(values: list, share: float) -> float:
    return sorted(values)[min(len(values) - 1, int(share * len(values)))] if values else float("nan")


class Page:
    def __init__(self, url: str, width: int, height: int) -> None:
        self.browser = start_browser(width + 400, height + 300)
        self.browser.set_script_timeout(120)
        start = time.monotonic()
        self.browser.get(url)
        self.wait("return globalThis.raystage?.state.picture")
        self.first_picture = time.monotonic() - start
        # The picture has exactly this size.
        self.js(f"const s = document.getElementById('stage').style; s.width = '{width}px'; s.height = '{height}px'")
        self.wait("return raystage.view.width >= arguments[0] - 2 || raystage.view.height >= arguments[1] - 2", width, height)
        self.rest()

    def js(self, script: str, *arguments):
        return self.browser.execute_script(script, *arguments)

    def wait(self, script: str, *arguments):
        return WebDriverWait(self.browser, 120, poll_frequency=0.01).until(lambda _: self.js(script, *arguments))

    def rest(self) -> dict:
        self.wait("return !raystage.view.wanted && raystage.view.underWay.size === 0 && !raystage.view.next"
                  " && raystage.state.picture.quality === 'resting' && raystage.state.picture.final")
        return self.js("return raystage.state.picture")

    def drag(self, label: str) -> None:
        self.browser.execute_async_script(DRAG, 2)  # decodes the frames
        result = self.browser.execute_async_script(DRAG, 8)
        header = result["header"]
        print(f"{label}: {len(result['shown']) / result['seconds']:.1f} pictures/s, pointer to picture"
              f" {statistics.median(result['latency']):.0f} ms median, {percentile(result['latency'], 0.95):.0f} ms 95 %"
              f" ({header['width']}x{header['height']}, render {header['render_ms']:.1f} + picture {header['picture_ms']:.1f} ms)")
        self.rest()


def main() -> None:
    started = time.monotonic()
    viewer = Viewer(pathlib.Path(sys.argv[1]))
    try:
        print(f"server: {time.monotonic() - started:.2f} s until it listens")
        for width, height in ((640, 480), (1440, 1080)):
            page = Page(viewer.url, width, height)
            print(f"first picture after {page.first_picture:.2f} s")
            page.drag(f"focal_plane {width}x{height}")
            page.browser.quit()
    finally:
        viewer.end()


if __name__ == "__main__":
    main()
