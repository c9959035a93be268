# SPDX-License-Identifier: Apache-2.0
"""Runs raystage and reads the frames that it renders, for the scripts in this folder."""

import os
import pathlib
import subprocess
import tempfile

import numpy as np


def run(*arguments):
    """Runs raystage; returns what it prints."""
    program = pathlib.Path(os.environ["RAYSTAGE_BIN_DIR"]) / "raystage"
    return subprocess.run([program, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


def channels(file, names, size):
    """Returns the named channels of an EXR or picture of `size` (width, height): rows, columns, channels."""
    names, (width, height) = list(names), size
    with tempfile.TemporaryDirectory() as folder:
        three = pathlib.Path(folder) / "three.exr"
        found = []
        for first in range(0, len(names), 3):
            wanted = (names[first:first + 3] + 2 * names[-1:])[:3]
            subprocess.run(["oiiotool", file, "--ch", ",".join(wanted), "--chnames", "R,G,B", "-d", "float", "-o", three], check=True)
            raw = subprocess.run(["ffmpeg", "-nostdin", "-v", "error", "-i", three, "-f", "rawvideo", "-pix_fmt", "gbrpf32le", "-"],
                                 check=True, capture_output=True).stdout
            planes = np.frombuffer(raw, "<f4").reshape(3, height, width)
            found += [planes[2], planes[0], planes[1]]
    return np.stack(found[:len(names)], -1).astype(float)


def srgb(light):
    """Returns the sRGB codes of linear light, 0 to 1."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def linear(codes):
    """Returns the linear light of sRGB codes."""
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def view_frames(views, frames):
    """Returns the frames of a simulated shot that its true views show."""
    return [1 + round(i * (frames - 1) / (views - 1)) for i in range(views)]
