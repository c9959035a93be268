#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reads a take without Raystage: lists every frame, time and gap, and renders a picture of the focal plane.

Follows docs/formats, which define all that it does. Needs numpy, zstd (timelines), ffmpeg (pictures) and djxl (JPEG XL). Not supported
in pictures: fisheyes, arrays that are a row or look outwards, flat fields, matrices, hot pixels, PQ and HLG, primaries, video.
"""
import argparse
import json
import pathlib
import struct
import subprocess
import sys
import tempfile

import numpy as np

STATUS = ["stored", "dropped by the source", "memory full", "not encoded", "torn", "lost at start-up", "not written", "late",
          "not a JPEG of this size", "memory ceiling", "stored, unverified"]
SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671fcb79e64eccc0e578825ad07dccff7221b8084674f743248ee03590e6813a264c"
    "3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931c89f7ec9d9787364"
    "eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e")
KINDS = {"PICTURE": "jxl", "HEVC": "hevc", "V_AV1": "obu"}  # of files, by parts of codecs' names
SRGB = (lambda light: np.where(light <= 0.0031308, light * 12.92, 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055),
        lambda value: np.where(value <= 0.04045, value / 12.92, ((np.maximum(value, 0) + 0.055) / 1.055) ** 2.4))
POWER = (lambda light: light ** (1 / 2.4), lambda value: value**2.4)  # a scale on which light is blended: its value, and back


def require(holds, what):
    if not holds:
        sys.exit(f"read_take.py: {what}")


def xxh3(data):
    """Returns the XXH3-64 (seed 0) of more than 240 bytes, or None of fewer, which the algorithm treats in other ways."""
    if len(data) <= 240:
        return None
    prime, prime32, mask, count = 0x9E3779B185EBCA87, 0x9E3779B1, 2**64 - 1, (len(data) - 1) // 64
    acc = np.array([0xC2B2AE3D, prime, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x85EBCA77C2B2AE63, 0x85EBCA77, 0x27D4EB2F165667C5,
                    prime32], np.uint64)
    words = np.vstack([np.frombuffer(data, "<u8", 8 * count).reshape(-1, 8), np.frombuffer(data[-64:], "<u8")])
    keyed = words ^ np.array([np.frombuffer(SECRET, "<u8", 8, 8 * (i % 16) if i < count else 121) for i in range(count + 1)])
    sums = words[:, [1, 0, 3, 2, 5, 4, 7, 6]] + (keyed & np.uint64(2**32 - 1)) * (keyed >> np.uint64(32))
    for block in range((len(data) - 1) // 1024):
        acc = acc + sums[16 * block:16 * block + 16].sum(axis=0)
        acc = (acc ^ (acc >> np.uint64(47)) ^ np.frombuffer(SECRET, "<u8", 8, 128)) * np.uint64(prime32)
    acc = acc + sums[(len(data) - 1) // 1024 * 16:].sum(axis=0)
    mixed, result = [int(a) ^ b for a, b in zip(acc, struct.unpack_from("<8Q", SECRET, 11))], len(data) * prime
    for product in (mixed[i] * mixed[i + 1] for i in range(0, 8, 2)):
        result = (result + ((product & mask) ^ (product >> 64))) & mask
    return (result := ((result ^ (result >> 37)) * 0x165667919E3779F9) & mask) ^ (result >> 32)


def crc24(data):
    rest = int.from_bytes(data, "big") << 24 ^ 0xB704CE << 8 * len(data)
    for bit in range(8 * len(data) + 23, 23, -1):
        rest ^= (rest >> bit & 1) * 0x1864CFB << bit - 24
    return rest


def elements(data, at, end):
    """Yields (id, first byte, end) of the EBML elements in data[at:end], up to one that is cut off. Data ends with 12 more zeros."""
    while at < end and data[at] >= 16:  # ids have one to four bytes, sizes one to eight
        name = int.from_bytes(data[at:(at := at + 9 - data[at].bit_length())], "big")
        bits = 7 * (9 - data[at].bit_length())
        size = int.from_bytes(data[at:(at := at + bits // 7)], "big") & (2**bits - 1)
        first, at = at, end if size == 2**bits - 1 or name == 0x18538067 else at + size  # unknown size; a Segment may be cut
        if at <= end:
            yield name, first, at


def read_matroska(data):
    """Returns codec and blocks {offset: (size, time ns)} of an archive, after which 12 zeros follow."""
    codec, scale, blocks = "", 1, {}
    for top, first, end in elements(data, 0, len(data) - 12):
        for name, begin, stop in elements(data, first, end) if top == 0x18538067 else ():  # Segment
            parts = {n: data[a:b] for n, a, b in elements(data, begin, stop)} if name in (0x1549A966, 0x1F43B675) else {}
            if name == 0x1549A966:  # Info: TimestampScale
                scale = int.from_bytes(parts[0x2AD7B1], "big")
            elif name == 0x1654AE6B:  # Tracks: TrackEntry, CodecID
                track = next((a, b) for n, a, b in elements(data, begin, stop) if n == 0xAE)
                codec = next(data[a:b].decode() for n, a, b in elements(data, *track) if n == 0x86)
            elif name == 0x1F43B675:  # Cluster: Timestamp, SimpleBlock (track number, relative time, flags, frame)
                (relative,), size = struct.unpack_from(">h", parts[0xA3], 1), len(parts[0xA3]) - 4
                blocks[stop - size] = size, (int.from_bytes(parts[0xE7], "big") + relative) * scale
    return codec, blocks


def read_journal(data, name):
    """Yields time ns, offset, size, status, XXH3, arrival ns, sequence number of the records that pass their check (of version 2)."""
    magic, version, step = struct.unpack_from("<8sII", data.ljust(16))
    require(magic == b"RAYSJRNL" and (version, step) in ((1, 32), (2, 48)), f"{name}: not a journal of version 1 or 2")
    for at, record in ((at, data[at:at + step]) for at in range(64, len(data) - step + 1, step)):
        if version == 1 and record[20] < 11 or crc24(record[:21] + bytes(3) + record[24:]) == int.from_bytes(record[21:24], "little"):
            time, offset, size, status, _, digest, arrival, sequence = struct.unpack("<qQIB3sQqQ", record.ljust(48, b"\0"))
            yield time, offset, size, status, digest, None if version == 1 or arrival == -2**63 else arrival, sequence
        else:
            print(f"{name}: the record at byte {at} fails its check", file=sys.stderr)


class Take:
    def __init__(self, folder):
        self.document, self.rig = (json.loads((folder / name).read_text()) for name in ("take.json", "rig.json"))
        require(all(document["schema"] in (f"raystage/{kind}/1", f"raystage/{kind}/2")
                    for kind, document in (("take", self.document), ("rig", self.rig))), f"{folder}: no take and rig of version 1 or 2")
        self.bytes, self.cameras, self.timeline = [], [], None
        for camera in self.document["cameras"]:
            files = [folder / camera[name] for name in ("archive", "journal")]
            require("/" not in camera["id"] and all(folder.resolve() in file.resolve().parents for file in files), f"{files}: outside")
            archive, journal = (file.read_bytes() if file.exists() else b"" for file in files)
            (codec, blocks), frames, gaps = read_matroska(archive + bytes(12)), [], []
            for time, offset, size, status, digest, arrival, sequence in read_journal(journal, files[1]) if journal else ():
                record = {"time_ns": time, "status": status, "reason": STATUS[status], "arrival_ns": arrival, "sequence": sequence}
                if status in (0, 10):
                    record.update(offset=offset, size=size, xxh3=f"{digest:016x}", is_block=blocks.pop(offset, None) == (size, time))
                    record["intact"] = offset + size <= len(archive) and xxh3(archive[offset:offset + size]) in (digest, None)
                (frames if status in (0, 10) else gaps).append(record)
            frames += [{"time_ns": time, "offset": offset, "size": size, "intact": None} for offset, (size, time) in blocks.items()]
            self.bytes.append(archive)
            self.cameras.append({"id": camera["id"], "codec": codec, "frames": sorted(frames, key=lambda f: f["time_ns"]), "gaps": gaps})
        if (folder / "timeline.zst").exists():
            data = subprocess.run(["zstd", "-dcq", folder / "timeline.zst"], check=True, stdout=subprocess.PIPE).stdout
            magic, version, count, _, rate, _, ticks = struct.unpack_from("<8sIIQdqQ", data)
            require(magic == b"RAYSTIME" and version in (1, 2) and count == len(self.cameras), "not a timeline of this take")
            table = np.frombuffer(data, "<i4", count * ticks, 48 + 8 * ticks).reshape(count, ticks).tolist()
            self.timeline = {"rate_hz": rate, "ticks_ns": np.frombuffer(data, "<i8", ticks, 48).tolist(), "frames": table}

    def frame(self, camera, index):
        """Returns the file of a stored frame: a JPEG, unpacked if it is packed, the JPEG XL of more than 8 bits, or a packet of video."""
        frame, codec = self.cameras[camera]["frames"][index], self.cameras[camera]["codec"]
        data = self.bytes[camera][frame["offset"]:frame["offset"] + frame["size"]]
        if codec == "V_JPEGXL" and data.startswith(bytes.fromhex("0000000c4a584c200d0a870a")):
            packed, data = data, decoded_by_djxl(data, "frame.jpg")
            require((xxh3(data), len(data)) == struct.unpack_from("<QI", packed, 56), "a packed frame does not give its JPEG")
        return data

    def light(self, camera, index):
        """Returns the linear light of a frame [height][width][3], 1 = white, before the camera's calibration."""
        size, pixels = [self.rig["cameras"][camera][name] for name in ("height", "width")], self.document["cameras"][camera].get("pixels")
        if pixels:
            kind, sample, step = ("ppm", "u2", 1) if pixels["samples"] == "integer" else ("pfm", "f4", -1)  # PFM: rows from the bottom up
            _, _, most, data = decoded_by_djxl(self.frame(camera, index), "frame." + kind).split(b"\n", 3)
            values = np.frombuffer(data, ("<" if most[:1] == b"-" else ">") + sample).reshape(*size, 3)[::step]
            values = values / (65535 if pixels["samples"] == "integer" and values.max() > float(most) else abs(float(most)))  # of djxl 0.7
            return SRGB[1](values) if pixels["transfer"] == "srgb" else values
        command = "ffmpeg -v error -f mjpeg -i pipe:0 -sws_flags bicubic+accurate_rnd+full_chroma_int -pix_fmt rgb24 -f rawvideo -"
        decoded = subprocess.run(command.split(), input=self.frame(camera, index), check=True, stdout=subprocess.PIPE).stdout
        codes = np.frombuffer(decoded, np.uint8).reshape(*size, 3) / 255
        return SRGB[1](codes) if self.document["color_space"] == "srgb_texture" else codes


def decoded_by_djxl(data, name):  # the end of `name` chooses the kind of file
    with tempfile.TemporaryDirectory() as folder:
        pathlib.Path(folder, "frame.jxl").write_bytes(data)
        subprocess.run(["djxl", "frame.jxl", name], cwd=folder, check=True, stderr=subprocess.DEVNULL)
        return pathlib.Path(folder, name).read_bytes()


def bilinear(image, x, y):
    """Returns image[y][x] between pixel centres, which are at +0.5; constant beyond the outermost."""
    x, y = np.clip(x - 0.5, 0, image.shape[1] - 1), np.clip(y - 0.5, 0, image.shape[0] - 1)
    left, top = x.astype(int), y.astype(int)
    right, bottom, fx, fy = np.minimum(left + 1, image.shape[1] - 1), np.minimum(top + 1, image.shape[0] - 1), x - left, y - top
    return sum(image[row, column] * (down * across)[..., None]
               for row, down in ((top, 1 - fy), (bottom, fy)) for column, across in ((left, 1 - fx), (right, fx)))


def side(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def in_circle(a, b, c, d):
    a, b, c = ((p[0] - d[0], p[1] - d[1]) for p in (a, b, c))
    return sum((p[0] ** 2 + p[1] ** 2) * (q[0] * r[1] - q[1] * r[0]) for p, q, r in ((a, b, c), (b, c, a), (c, a, b)))


def flip_edges(apex, points, is_wanted):
    """Flips inner edges until none is wanted. `apex`: the corner to the left of each directed edge (a, b)."""
    changed = True
    while changed:
        changed = False
        for a, b in sorted(edge for edge in apex if edge[0] < edge[1]):
            left, right = apex.get((a, b)), apex.get((b, a))
            if None not in (left, right) and is_wanted(a, b, left, right) and min(
                    side(points[right], points[b], points[left]), side(points[left], points[a], points[right])) > 0:
                del apex[a, b], apex[b, a]
                apex.update({(right, b): left, (b, left): right, (left, right): b, (left, a): right, (a, right): left, (right, left): a})
                changed = True


def delaunay(points):
    """Returns the Delaunay triangulation of integer points, as flip_edges() has it: a sweep by x, then Lawson's flips."""
    apex, hull, order = {}, set(), sorted(range(len(points)), key=points.__getitem__)
    for before, p in zip(order, order[1:]):
        visible = [(a, b) for a, b in hull if side(points[a], points[b], points[p]) < 0]
        hull |= set() if visible else {(before, p), (p, before)}  # the first points may be in one line
        for a, b in visible:
            apex.update({(b, a): p, (a, p): b, (p, b): a})
            hull.remove((a, b))
            for edge in ((a, p), (p, b)):
                hull.remove(edge[::-1]) if edge[::-1] in hull else hull.add(edge)
    flip_edges(apex, points, lambda *corners: in_circle(*(points[i] for i in corners)) > 0)
    return apex


def triangles_of_array(centres, axis, cells):
    """Returns sorted triangles of indices of `centres` [n][3]. `cells`: (column, row) of each camera of a grid, otherwise empty."""
    scaled = (centres - centres[0]) / max(np.linalg.norm(np.ptp(centres, axis=0)), 1e-300)
    line, across, normal = np.linalg.svd(scaled - scaled.mean(axis=0))[2]
    require(len(centres) > 2 and np.ptp(scaled @ across) >= 0.1 * np.diff(np.sort(scaled @ line)).min(), "rows are not supported")
    normal *= -np.sign(normal @ axis)
    up = (up := np.cross(normal, np.eye(3)[0 if abs(normal[0]) < 0.9 else 1])) / np.linalg.norm(up)
    points = [tuple(round(float(axis @ p) * 2**26) for axis in (np.cross(up, normal), up)) for p in scaled]
    cells = [(sorted({c for c, _ in cells}).index(column), sorted({r for _, r in cells}).index(row)) for column, row in cells]

    def is_wanted(a, b, left, right):
        (xa, ya), (xb, yb) = cells[a], cells[b]
        dx, dy = xb - xa, yb - ya
        if abs(dx) == abs(dy) == 1 and {(xa, yb), (xb, ya)} <= set(cells):  # a diagonal of a full cell: the shorter one
            longer = np.hypot(*np.subtract(points[a], points[b])) - np.hypot(*np.subtract(points[left], points[right]))
            return longer > 0 if abs(longer) > 4 else dx * dy < 0
        is_side = abs(dx) + abs(dy) == 1 and any({(xa + s * dy, ya + s * dx), (xb + s * dy, yb + s * dx)} <= set(cells) for s in (1, -1))
        return not is_side and in_circle(*(points[i] for i in (a, b, left, right))) > 0

    apex = delaunay(cells or points)
    turns = {np.sign(side(points[a], points[b], points[c])) for (a, b), c in apex.items()}
    if cells and turns in ({1}, {-1}):  # the grid agrees with the positions
        apex = apex if turns == {1} else {(b, a): c for (a, b), c in apex.items()}
        flip_edges(apex, points, is_wanted)
    return sorted((a, b, c) for (a, b), c in (apex if turns in ({1}, {-1}) else delaunay(points)).items() if a < min(b, c))


def focal_plane_picture(take, view, depth):
    """Returns linear light [height][width][3] and A [height][width] of a view: see docs/formats/picture.md."""
    rig, k, pose = take.rig["cameras"], view["intrinsics"], np.array(view["world_from_camera"])
    poses = np.array([camera["world_from_camera"] for camera in rig])
    centres, axis = poses[:, :3, 3], -poses[:, :3, 2].sum(axis=0) / np.linalg.norm(poses[:, :3, 2].sum(axis=0))
    is_flat = "distortion" not in k and np.linalg.norm(poses[:, :3, 2].sum(axis=0)) >= 0.8 * len(rig)
    require(take.timeline and is_flat, "views need a timeline, no lens distortion, and an array that does not look outwards")
    frames = [row[np.argmin(abs(np.array(take.timeline["ticks_ns"]) - view["time_ns"]))] for row in take.timeline["frames"]]
    present = [i for i, frame in enumerate(frames) if frame >= 0 and take.cameras[i]["frames"][frame]["intact"] is not False]
    is_grid = take.rig.get("topology") != "delaunay" and all("row" in rig[i] for i in present)
    x, y = np.meshgrid(np.arange(view["width"]) + 0.5, np.arange(view["height"]) + 0.5)
    rays = np.dstack([(x - k["cx"]) / k["fx"], (k["cy"] - y) / k["fy"], -np.ones_like(x)]) @ pose[:3, :3].T
    eye, weights, color, alpha = pose[:3, 3], np.zeros((len(rig),) + x.shape), np.zeros(x.shape + (3,)), np.zeros(x.shape)
    for triangle in triangles_of_array(centres[present], axis, [(rig[i]["col"], rig[i]["row"]) for i in present if is_grid]):
        a, b, c = centres[cameras := np.array(present)[list(triangle)]]
        total = rays @ np.cross(b - a, c - a)
        shares = [rays @ np.cross(p - eye, q - eye) * np.sign(total) for p, q in ((b, c), (c, a), (a, b))]
        inside = (weights.sum(axis=0) == 0) & (total != 0) & (np.min(shares, axis=0) >= -1e-9 * abs(total))
        weights[cameras] += np.where(inside, (shares := np.maximum(shares, 0)) / np.maximum(shares.sum(axis=0), 1e-300), 0)
    distance = (axis @ centres.mean(axis=0) + depth - axis @ eye) / (rays @ axis)
    responses = [camera.get("photometric", {"brightness": [0, 0, 0], "contrast": [1, 1, 1]}) for camera in rig]
    deep = [camera.get("pixels", {"peak": 0, "transfer": "srgb"}) for camera in take.document["cameras"]]
    full_scale = max([1] + [b + c * (d["peak"] or 1) for d, r in zip(deep, responses) for b, c in zip(r["brightness"], r["contrast"])])
    coded, uncoded = POWER if full_scale > 1 and any(d["peak"] for d in deep) else SRGB
    for i in (i for i in present if weights[i].any()):
        lens, width, height = rig[i]["intrinsics"], rig[i]["width"], rig[i]["height"]
        require(lens.get("projection", "pinhole") == "pinhole" and set(responses[i]) == {"brightness", "contrast"}
                and "JP" in take.cameras[i]["codec"] and deep[i]["transfer"] in ("srgb", "linear") and "chromaticities" not in deep[i],
                "not supported, see the beginning")
        right, up, back = np.moveaxis((eye + distance[..., None] * rays - centres[i]) @ poses[i, :3, :3], 2, 0)
        u, v = right / -back, up / back
        k1, k2, k3, p1, p2 = (lens.get("distortion", {}).get(name, 0) for name in ("k1", "k2", "k3", "p1", "p2"))
        roots = [np.roots([c * k3, 0, b * k2, 0, a * k1, -6 * np.hypot(p1, p2), 1]) for a, b, c in ((3, 5, 7), (1, 1, 1))]
        fold = min((r.real for r in np.concatenate(roots) if abs(r.imag) < 1e-9 and r.real > 0), default=np.inf)
        factor = 1 + (s := u * u + v * v) * (k1 + s * (k2 + s * k3))
        px = lens["fx"] * (u * factor + 2 * p1 * u * v + p2 * (s + 2 * u * u)) + lens["cx"]
        py = lens["fy"] * (v * factor + p1 * (s + 2 * v * v) + 2 * p2 * u * v) + lens["cy"]
        seen = np.clip(2 * np.min([px, width - px, py, height - py], axis=0), 0, 1) * np.clip((1 - s / fold**2) * 100, 0, 1)
        alpha += (weight := np.where((back < 0) & (distance > 0), weights[i] * seen, 0))
        light = np.array(responses[i]["brightness"]) + np.array(responses[i]["contrast"]) * take.light(i, frames[i])
        color += weight[..., None] * bilinear(coded(np.clip(light / full_scale, 0, 1)), px, py)
    return uncoded(color / np.maximum(alpha, 1e-300)[..., None]) * full_scale, alpha


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("take", type=pathlib.Path, help="folder of the take")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True, help="folder for take.json, picture.exr, CAMERA.INDEX.jpg")
    parser.add_argument("--views", type=pathlib.Path, help="document raystage/views/1, of whose first view a picture is rendered")
    parser.add_argument("--depth-m", type=float, default=4, help="distance of the focal plane from the array, metres (default: 4)")
    take = Take((options := parser.parse_args()).take)
    options.output.mkdir(exist_ok=True)
    (options.output / "take.json").write_text(json.dumps({"cameras": take.cameras, "timeline": take.timeline}, indent=1))
    for i, camera in enumerate(take.cameras):
        kind = next((KINDS[part] for part in camera["codec"].split("/") if part in KINDS), "jpg")
        for index in (index for index, frame in enumerate(camera["frames"]) if frame["intact"] is not False):
            (options.output / f"{camera['id']}.{index}.{kind}").write_bytes(take.frame(i, index))
    if options.views:
        light, alpha = focal_plane_picture(take, json.loads(options.views.read_text())["views"][0], options.depth_m)
        command = f"ffmpeg -v error -y -f rawvideo -pix_fmt gbrapf32le -s {alpha.shape[1]}x{alpha.shape[0]} -i pipe:0".split()
        planes = np.stack([light[..., 1], light[..., 2], light[..., 0], np.ones(alpha.shape)]) * alpha
        subprocess.run(command + [options.output / "picture.exr"], input=planes.astype("<f4").tobytes(), check=True)


if __name__ == "__main__":
    main()
