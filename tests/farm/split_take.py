#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes a folder OUT/RANK/take per rank with a take's documents and the archives of a compact block of its cameras.
The cameras form a square grid, row by row. Archives are hard links.
Usage: split_take.py TAKE OUT RANKS      (RANKS: 1, 2, 4, 8, ...)"""
import json
import math
import os
import pathlib
import shutil
import sys

take, out, ranks = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), int(sys.argv[3])
cameras = json.loads((take / "take.json").read_text())["cameras"]
side = math.isqrt(len(cameras))
columns = 2 if ranks >= 4 else 1  # of ranks
for rank in range(ranks):
    own = out / str(rank) / "take"
    (own / "archive").mkdir(parents=True)
    for document in ("take.json", "rig.json", "timeline.zst"):
        shutil.copy(take / document, own / document)
    for index, camera in enumerate(cameras):
        row, column = divmod(index, side)
        if row * (ranks // columns) // side * columns + column * columns // side != rank:
            continue
        for file in ("archive", "journal"):
            os.link(take / camera[file], own / camera[file])
