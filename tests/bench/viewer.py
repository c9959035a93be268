#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures the viewer in Chromium on this machine, which the browser shares.

    viewer.py drag TAKE      start, dragging the camera at 640x480 and 1920x1080, refinement, click to focus
    viewer.py play TAKE      playing from a cold page cache, three times
    viewer.py memory TAKE [MINUTES]     memory of the server while it flies and plays, once per half minute
    viewer.py viewers TAKE   ten pages that drag at once: pictures per second of each, memory of the server
    viewer.py live TAKE [SECONDS]       follows a recording: age of what is shown, and how the cameras do

RAYSTAGE_BIN_DIR: folder of the programs (default: build/release/bin).
"""
import os
import pathlib
import statistics
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
os.environ.setdefault("RAYSTAGE_BIN_DIR", str(ROOT / "build/release/bin"))
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
  const measured = raystage.view.statistics;
  send('pointerup', x0, y0);
  done({...measured, header: raystage.state.picture});
}, 8);
"""


def percentile(values: list, share: float) -> float:
    return sorted(values)[min(len(values) - 1, int(share * len(values)))] if values else float("nan")


def rate(shown: list) -> float:
    """Pictures per second between the first and the last one; times in ms."""
    return (len(shown) - 1) * 1000 / (shown[-1] - shown[0]) if len(shown) > 1 else 0


class Page:
    """A page whose picture has this size. `unlimited`: animation frames as fast as they are drawn, and not at 60 Hz."""

    def __init__(self, url: str, width: int, height: int, unlimited: bool = False) -> None:
        self.browser = start_browser(width + 400, height + 300, unlimited)
        self.browser.set_script_timeout(120)
        start = time.monotonic()
        self.browser.get(url)
        self.wait("return globalThis.raystage?.state.picture")
        self.first_picture = time.monotonic() - start
        self.js(f"const s = document.getElementById('stage').style; s.width = '{width}px'; s.height = '{height}px';"
                f"raystage.view.setAspect({width} / {height})")
        self.wait("return raystage.view.width === arguments[0] && raystage.view.height === arguments[1]", width, height)
        self.rest()

    def js(self, script: str, *arguments):
        return self.browser.execute_script(script, *arguments)

    def wait(self, script: str, *arguments):
        return WebDriverWait(self.browser, 120, poll_frequency=0.01).until(lambda _: self.js(script, *arguments))

    def rest(self) -> dict:
        self.wait("return !raystage.view.wanted && raystage.view.underWay.size === 0 && !raystage.view.next"
                  " && raystage.state.picture.quality === 'resting' && raystage.state.picture.final")
        return self.js("return raystage.state.picture")

    def drag(self, label: str, seconds: int = 8) -> dict:
        self.browser.execute_async_script(DRAG, 2)  # decodes the frames
        result = self.browser.execute_async_script(DRAG, seconds)
        header = result["header"]
        print(f"{label}: {rate(result['shown']):.1f} pictures/s, pointer to picture"
              f" {statistics.median(result['latency']):.0f} ms median, {percentile(result['latency'], 0.95):.0f} ms 95 %"
              f" ({header['width']}x{header['height']}, render {header['render_ms']:.1f} + picture {header['picture_ms']:.1f} ms)", flush=True)
        self.rest()
        return result

    def refine(self, method: str) -> list:
        """Returns for each picture of a refinement by a method its method and the time since the request, seconds."""
        return self.browser.execute_async_script("""
          const [method, done] = arguments, view = raystage.view, found = [];
          const json = JSON.parse(raystage.shotText.text());
          json.layers[0].method = method;
          delete json.layers[0].options;
          raystage.connection.ask('shot', {file: raystage.shotText.file, text: JSON.stringify(json)}).then(() => {
            const start = performance.now(), receive = view.receive;
            view.receive = async function(header, jpeg) {
              await receive.call(view, header, jpeg);
              if (header.quality !== 'resting') return;
              found.push([header.method || method, (performance.now() - start) / 1000]);
              if (!header.final) return;
              view.receive = receive;
              done(found);
            };
            view.rest();
          });""", method)

    def play(self, seconds: float) -> dict:
        self.js("""raystage.timeline.loop = true;
          const view = raystage.view, record = Object.getPrototypeOf(view).record;
          view.record = function(header, now, input) {
            if (header.quality === 'playing') raystage.times.push([now, header.render_ms + header.picture_ms]);
            record.call(view, header, now, input);
          };
          raystage.times = []; document.getElementById('play').click()""")
        time.sleep(seconds)
        result = self.js("""const s = {...raystage.playback.statistics, times: raystage.times};
          document.getElementById('play').click(); return s""")
        return result


def resident_megabytes(viewer: Viewer) -> float:
    status = pathlib.Path(f"/proc/{viewer.process.pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


def forget_page_cache(take: pathlib.Path) -> None:
    os.sync()
    for file in (take / "archive").iterdir():
        descriptor = os.open(file, os.O_RDONLY)
        os.posix_fadvise(descriptor, 0, 0, os.POSIX_FADV_DONTNEED)
        os.close(descriptor)


def drag(viewer: Viewer, _: pathlib.Path, *arguments: str) -> None:
    page = Page(viewer.url, 640, 480)
    print(f"first picture after {page.first_picture:.2f} s", flush=True)
    page.drag("focal_plane 640x480 at 60 Hz")
    for x, y in ((320, 260), (200, 200), (420, 300)):
        page.js("raystage.state.focusMs = null")
        page.js("""const c = document.getElementById('picture'), b = c.getBoundingClientRect(), at = {bubbles: true,
          clientX: b.left + arguments[0], clientY: b.top + arguments[1], button: 0, pointerId: 1}; c.setPointerCapture = () => {};
          c.dispatchEvent(new PointerEvent('pointerdown', at)); c.dispatchEvent(new PointerEvent('pointerup', at))""", x, y)
        page.wait("return raystage.state.focusMs")
        print(f"click to focus: {page.js('return raystage.state.focusMs'):.0f} ms", flush=True)
        page.rest()
    for method in ("plane_sweep", "depth", "depth", "lumigraph"):
        times = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in page.refine(method))
        print(f"refined by {method} at 640x480: {times}", flush=True)
    page.browser.quit()
    for width, height in ((640, 480), (1920, 1080)):
        page = Page(viewer.url, width, height, unlimited=True)
        page.drag(f"focal_plane {width}x{height}")
        page.browser.quit()


def play(viewer: Viewer, take: pathlib.Path, *arguments: str) -> None:
    """The first run decodes all frames; the next ones find some of them in the viewer's memory."""
    page = Page(viewer.url, 640, 480)
    print(f"first picture after {page.first_picture:.2f} s", flush=True)
    for _ in range(3):
        forget_page_cache(take)
        result = page.play(2.9)
        gaps = [b[0] - a[0] for a, b in zip(result["times"], result["times"][1:])]
        server = [t[1] for t in result["times"]]
        print(f"played: {result['wanted']} ticks, {max(0, result['wanted'] - result['shown'])} late, {len(server)} pictures,"
              f" at most {max(gaps):.0f} ms between pictures, server {statistics.median(server):.0f} ms median, {max(server):.0f} ms at most", flush=True)
        page.rest()
    page.browser.quit()


def memory(viewer: Viewer, _: pathlib.Path, minutes: str = "10") -> None:
    page = Page(viewer.url, 640, 480)
    start = time.monotonic()
    while time.monotonic() - start < 60 * float(minutes):
        page.browser.execute_async_script(DRAG, 10)
        page.play(10)
        page.rest()
        browser = page.js("return performance.memory.usedJSHeapSize / 1e6")
        print(f"{(time.monotonic() - start) / 60:.1f} min: server {resident_megabytes(viewer):.0f} MB, page {browser:.1f} MB", flush=True)
    page.browser.quit()


def viewers(viewer: Viewer, _: pathlib.Path, *arguments: str) -> None:
    pages = [Page(viewer.url, 320, 240)]
    for _ in range(9):  # further pages are tabs of one browser, each in a window of its own
        pages[0].browser.switch_to.new_window("window")
        pages[0].browser.get(viewer.url)
    browser = pages[0].browser
    for handle in browser.window_handles:
        browser.switch_to.window(handle)
        WebDriverWait(browser, 120).until(lambda b: b.execute_script("return globalThis.raystage?.state.picture"))
        browser.execute_script("""const send = () => raystage.setCamera({...raystage.camera(),
          position: [0.05 * Math.sin(performance.now() / 300), 0, 0]}); globalThis.timer = setInterval(send, 8);
          raystage.view.statistics = {shown: [], latency: []}; globalThis.pictures = 0;
          const receive = raystage.view.receive; raystage.view.receive = function(...a) { ++pictures; return receive.apply(this, a); }""")
    time.sleep(10)
    counts = []
    for handle in browser.window_handles:
        browser.switch_to.window(handle)
        counts.append(browser.execute_script("clearInterval(timer); return pictures"))
    print(f"ten viewers: {min(counts)} to {max(counts)} pictures each in about 10 s; server {resident_megabytes(viewer):.0f} MB", flush=True)
    browser.quit()


def live(viewer: Viewer, _: pathlib.Path, seconds: str = "60") -> None:
    # As the viewer itself: the recorder on this machine comes first.
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    browser = start_browser(1280, 720)
    browser.get(viewer.url)
    ages, end = [], time.monotonic() + float(seconds)
    while time.monotonic() < end:
        time.sleep(0.5)
        status = browser.execute_script("return raystage.live.status")
        if status and "age_s" in status:
            ages.append(status["age_s"])
    print(f"live: newest instant {statistics.median(ages):.2f} s old median, {percentile(ages, 0.95):.2f} s 95 %, {max(ages):.2f} s at most;"
          f" {sum(camera['dropped'] for camera in status['cameras'])} frames dropped", flush=True)
    browser.quit()


def main() -> None:
    action = {"drag": drag, "play": play, "memory": memory, "viewers": viewers, "live": live}[sys.argv[1]]
    take = pathlib.Path(sys.argv[2])
    if action is not live:
        forget_page_cache(take)
    started = time.monotonic()
    viewer = Viewer(take)
    print(f"server: {time.monotonic() - started:.2f} s until it listens", flush=True)
    try:
        action(viewer, take, *sys.argv[3:])
    finally:
        viewer.end()


if __name__ == "__main__":
    main()
