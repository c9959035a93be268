#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How soon a render answers SIGINT, and how soon it ends, for each method.

    stopping.py TAKE [WIDTH [ROUNDS]]

Renders a shot of TAKE (default: 1920 pixels wide), interrupts it after 0.3 to 3 s (default: 5 rounds), and prints the longest times in
seconds until the first line of the answer and until the end. Every round derives depths anew. RAYSTAGE_BIN_DIR: folder of the programs.
"""
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BIN = pathlib.Path(os.environ.get("RAYSTAGE_BIN_DIR", ROOT / "build/release/bin"))
METHODS = ("focal_plane", "nearest", "aperture", "lumigraph", "slabs", "plane_sweep", "depth", "auto")


def interrupt(shot: pathlib.Path, folder: pathlib.Path, after: float) -> tuple[float, float] | None:
    """Returns the times until the answer and the end; None if the render ended before the signal."""
    command = [BIN / "raystage-render", shot, "-o", folder / "f.####.exr", "--existing", "overwrite", "--cache", folder]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        for line in process.stderr:
            if line.startswith("writing "):
                break
        time.sleep(after)
        if process.poll() is not None:
            return None
        begin = time.monotonic()
        process.send_signal(signal.SIGINT)
        answered = None
        for line in process.stderr:
            if answered is None and "stopping" in line:
                answered = time.monotonic() - begin
        process.wait()
        ended = time.monotonic() - begin
        if process.returncode != 130:
            return None
        return answered, ended


def main() -> None:
    take = pathlib.Path(sys.argv[1]).resolve()
    width = int(sys.argv[2]) if len(sys.argv) > 2 else 1920
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 5
    print("| method | answer, s | end, s | interrupted |\n| --- | --- | --- | --- |")
    for method in METHODS:
        times = []
        for number in range(rounds):
            with tempfile.TemporaryDirectory() as name:
                folder = pathlib.Path(name)
                shot = folder / "shot.json"
                shot.write_text(json.dumps({
                    "schema": "raystage/shot/3", "width": width, "height": width * 9 // 16, "fps": 24, "first_frame": 1, "last_frame": 400,
                    "camera": {"keys": [{"frame": 1, "position": [0, 0, 0], "horizontal_fov_deg": 50},
                                        {"frame": 400, "position": [0.1, 0, -0.1]}]},
                    "layers": [{"take": str(take), "method": method, "speed": 0}]}))
                found = interrupt(shot, folder, 0.3 + 2.7 * number / max(1, rounds - 1))
            if found is not None:
                times.append(found)
        longest = [max(column) for column in zip(*times)] if times else [float("nan")] * 2
        print(f"| `{method}` | {longest[0]:.2f} | {longest[1]:.2f} | {len(times)} of {rounds} |", flush=True)


if __name__ == "__main__":
    main()
