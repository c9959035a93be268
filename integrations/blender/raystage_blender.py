# SPDX-License-Identifier: Apache-2.0
"""Raystage in Blender: cameras to shots, takes and their scene into Blender, renders into the compositor.

Install this one file by Edit > Preferences > Add-ons > Install. Then:

* File > Export > Raystage Shot writes the active camera, with everything that animates it, to a shot.
* File > Import > Raystage Take adds the cameras of a take and a proxy of its scene.
* File > Import > Raystage Render loads a rendered sequence into the compositor.

Blender's world has z up, Raystage's has y up: (x, y, z) in Blender is (x, z, -y) in Raystage, times the scene's unit scale.
"""
import fractions
import json
import math
import os
import pathlib
import re
import shutil
import struct
import subprocess
import tempfile

import bpy
import bpy_extras.io_utils
import mathutils

bl_info = {
    "name": "Raystage",
    "author": "Raystage maintainers",
    "version": (0, 2, 0),
    "blender": (3, 4, 0),
    "location": "File > Import, File > Export",
    "description": "Light field video: cameras to shots, takes and renders into Blender",
    "doc_url": "",
    "category": "Import-Export",
}

SHOT_SCHEMA = "raystage/shot/3"
MAX_DOCUMENT_BYTES = 64 << 20
MAX_HEADER_BYTES = 16 << 20
PROXY_SECONDS = 3600
WORLD_FROM_BLENDER = mathutils.Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


class RaystageError(Exception):
    """What failed and what to do, for the user."""


def read_document(file: pathlib.Path) -> dict:
    try:
        if file.stat().st_size > MAX_DOCUMENT_BYTES:
            raise RaystageError(f"{file}: the file is larger than {MAX_DOCUMENT_BYTES >> 20} MiB")
        document = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise RaystageError(f"{file}: {error}") from error
    if not isinstance(document, dict):
        raise RaystageError(f"{file}: found no JSON object")
    return document


# ---- Camera to shot ----

def frame_rate(scene):
    """Returns the frame rate as a shot has it: a number, or a ratio as text."""
    rate = fractions.Fraction(scene.render.fps) / fractions.Fraction(scene.render.fps_base).limit_denominator(2000)
    return rate.numerator if rate.denominator == 1 else f"{rate.numerator}/{rate.denominator}"


def picture_size(scene) -> tuple[int, int]:
    render = scene.render
    if not math.isclose(render.pixel_aspect_x, render.pixel_aspect_y):
        raise RaystageError("The pixel aspect ratio is not 1. Raystage renders square pixels: set it to 1 in the output properties.")
    return tuple(max(1, size * render.resolution_percentage // 100) for size in (render.resolution_x, render.resolution_y))


def film_back(camera, size: tuple[int, int]) -> tuple[float, float]:
    """Returns the width of the film back in mm, and the film back widths of one unit of Blender's lens shift."""
    width, height = size
    vertical = camera.sensor_fit == "VERTICAL"
    if vertical or (camera.sensor_fit == "AUTO" and height > width):
        sensor = camera.sensor_height if vertical else camera.sensor_width  # spans the picture's height
        return sensor * width / height, height / width
    return camera.sensor_width, 1.0


def camera_at(scene, depsgraph, size: tuple[int, int]) -> dict:
    """Returns the properties of the active camera at the scene's frame, in the words of a shot."""
    if scene.camera is None:
        raise RaystageError("The scene has no active camera. Choose one in the scene properties.")
    found = scene.camera.evaluated_get(depsgraph)
    camera = found.data
    if not isinstance(camera, bpy.types.Camera):
        raise RaystageError(f"The active object \"{scene.camera.name}\" is not a camera. Choose a camera in the scene properties.")
    if camera.type != "PERSP":
        raise RaystageError(f"The camera \"{found.name}\" is not a perspective camera. Raystage renders perspective views: change its type.")
    scale = scene.unit_settings.scale_length
    matrix = WORLD_FROM_BLENDER @ found.matrix_world
    if matrix.to_3x3().determinant() < 0:
        raise RaystageError(f"The camera \"{found.name}\" is mirrored. Remove the negative scale of its parents.")
    width_mm, shift_unit = film_back(camera, size)
    rotation = matrix.to_quaternion().normalized()
    state = {
        "position": [value * scale for value in matrix.translation],
        "orientation": list(rotation),
        "film_back_mm": width_mm,
        "focal_length_mm": camera.lens,
        "shift_x": camera.shift_x * shift_unit,
        "shift_y": camera.shift_y * shift_unit,
    }
    if scene.render.use_multiview:
        move_to_middle(state, matrix, scale, camera.stereo)
    if camera.dof.use_dof:
        distance = camera.dof.focus_distance
        if camera.dof.focus_object is not None:
            target = camera.dof.focus_object.evaluated_get(depsgraph).matrix_world.translation
            distance = -(found.matrix_world.normalized().inverted() @ target).z
        if distance > 0:
            state["focus_m"] = distance * scale
        state["f_number"] = camera.dof.aperture_fstop
    if scene.render.use_motion_blur:
        state["shutter_deg"] = 360 * scene.render.motion_blur_shutter
    return state


def rounded(value):
    """Returns numbers with nine digits, which is more than Blender's floats have."""
    if isinstance(value, list):
        return [rounded(item) for item in value]
    return float(f"{value:.9g}")


def keys_of(states: dict[int, dict]) -> list[dict]:
    """Returns a key for each frame, with the properties that change; the first key has all."""
    frames = sorted(states)
    first = states[frames[0]]
    names = {name for state in states.values() for name in state}
    moving = {name for name in names if any(states[frame].get(name) != first.get(name) for frame in frames)}
    keys = []
    for frame in frames:
        wanted = first if frame == frames[0] else moving
        key = {"frame": frame, **{name: rounded(states[frame][name]) for name in wanted if name in states[frame]}}
        if len(key) > 1:
            keys.append(key)
    return keys


def move_to_middle(state: dict, matrix, scale: float, stereo) -> None:
    """Moves a camera from where Blender's pivot has it to the middle between the eyes, in which a shot has it."""
    side = {"LEFT": 0.5, "RIGHT": -0.5}.get(stereo.pivot, 0.0)
    to_middle = matrix.to_3x3().col[0].normalized() * (side * stereo.interocular_distance * scale)
    state["position"] = [a + b for a, b in zip(state["position"], to_middle)]
    if stereo.convergence_mode == "OFFAXIS":
        ratio = side * stereo.interocular_distance / stereo.convergence_distance
        state["shift_x"] -= ratio * state["focal_length_mm"] / state["film_back_mm"]


def stereo_of(scene) -> dict:
    """Returns the stereo views of the active camera as a member of a shot's camera; empty: the scene has one view."""
    if not scene.render.use_multiview or scene.camera is None or not isinstance(scene.camera.data, bpy.types.Camera):
        return {}
    stereo = scene.camera.data.stereo
    if stereo.convergence_mode == "TOE" or scene.render.views_format != "STEREO_3D":
        raise RaystageError("Raystage renders two parallel views. Set Stereoscopy to Stereo 3D, and the camera's convergence to Off-Axis or Parallel.")
    scale = scene.unit_settings.scale_length
    found = {"interaxial_m": rounded(stereo.interocular_distance * scale)}
    if stereo.convergence_mode == "OFFAXIS":
        found["convergence_m"] = rounded(stereo.convergence_distance * scale)
    return {"stereo": found}


def shot_camera(context) -> dict:
    """Returns what a shot says about the scene's camera, evaluated at every frame: constraints, drivers and markers count."""
    scene = context.scene
    size = picture_size(scene)
    at_first = scene.frame_current, scene.frame_subframe
    states = {}
    stereo = None
    try:
        for frame in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(frame)
            of_frame = stereo_of(scene)
            if stereo is not None and of_frame != stereo:
                raise RaystageError(f"The stereo settings of the camera change at frame {frame}. A shot has the same ones at all frames: remove their keys.")
            stereo = of_frame
            states[frame] = camera_at(scene, context.evaluated_depsgraph_get(), size)
    finally:
        scene.frame_set(at_first[0], subframe=at_first[1])
    width_mm = states[scene.frame_start]["film_back_mm"]
    previous = None
    for state in states.values():
        # A shot has one film back: a sensor that changes is a lens that changes.
        state["focal_length_mm"] *= width_mm / state.pop("film_back_mm")
        if previous is not None and sum(a * b for a, b in zip(previous, state["orientation"])) < 0:
            state["orientation"] = [-value for value in state["orientation"]]
        previous = state["orientation"]
    if not any(state["shift_x"] or state["shift_y"] for state in states.values()):
        for state in states.values():
            del state["shift_x"], state["shift_y"]
    return {
        "width": size[0], "height": size[1], "fps": frame_rate(scene),
        "first_frame": scene.frame_start, "last_frame": scene.frame_end,
        "camera": {"film_back_mm": rounded(width_mm), **stereo, "keys": keys_of(states)},
    }


def merged_shot(shot: dict, given: dict, file: pathlib.Path) -> dict:
    """Returns a shot with another camera, size and range; all else stays."""
    schema = shot.get("schema")
    if schema not in ("raystage/shot/2", SHOT_SCHEMA):
        raise RaystageError(f"{file}: found the schema {schema!r}, allowed: {SHOT_SCHEMA}. Save the shot by `raystage replay` first.")
    if schema != SHOT_SCHEMA:
        for layer in shot.get("layers", []):
            if isinstance(layer, dict) and "take" in layer:
                layer.setdefault("method", "focal_plane")  # the default of that version
    camera = shot.get("camera")
    if isinstance(camera, dict) and camera.get("projection", "perspective") != "perspective":
        raise RaystageError(f"{file}: the shot's camera is {camera['projection']}, which Blender's perspective camera would replace. Choose another file.")
    stereo = camera.get("stereo") if isinstance(camera, dict) else None
    shot = {**shot, "schema": SHOT_SCHEMA, **given}
    if stereo is not None:
        shot["camera"] = {"stereo": stereo, **given["camera"]}
    return shot


def write_shot(context, file: pathlib.Path, take: str) -> int:
    """Writes the camera to a new shot of a take, or to an existing shot. Returns the number of keys."""
    given = shot_camera(context)
    if file.exists():
        shot = merged_shot(read_document(file), given, file)
    elif take:
        path = pathlib.Path(bpy.path.abspath(take))
        if not (path / "take.json").is_file():
            raise RaystageError(f"{path}: this folder is not a take: take.json is missing. Choose the folder of a take.")
        shot = {"schema": SHOT_SCHEMA, "name": pathlib.Path(file.name.split(".")[0]).name, **given,
                "layers": [{"take": os.path.relpath(path, file.parent)}]}
    else:
        raise RaystageError("A new shot needs a take: choose its folder in the sidebar, or choose an existing shot.")
    temporary = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        temporary.write_text(json.dumps(shot, indent=2) + "\n", encoding="utf-8")
        os.replace(temporary, file)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise RaystageError(f"{file}: {error}") from error
    return len(given["camera"]["keys"])


# ---- Take to scene ----

def rig_matrix(camera: dict) -> mathutils.Matrix:
    rows = camera["world_from_camera"]
    matrix = mathutils.Matrix([[float(value) for value in row] for row in rows])
    if len(rows) != 4 or any(len(row) != 4 for row in rows) or any(not math.isfinite(v) for row in matrix for v in row):
        raise ValueError("world_from_camera is not a matrix of 4 x 4 numbers")
    return WORLD_FROM_BLENDER.inverted() @ matrix


def remove_collection(collection) -> None:
    """Removes a collection with all that is in it alone."""
    for found in list(collection.objects):
        data = found.data
        bpy.data.objects.remove(found)
        if data is not None and data.users == 0:
            (bpy.data.cameras if isinstance(data, bpy.types.Camera) else bpy.data.meshes).remove(data)
    bpy.data.collections.remove(collection)


def add_take_cameras(context, take: pathlib.Path, collection) -> None:
    """Adds the cameras of a take's rig."""
    file = take / "rig.json"
    cameras = read_document(file).get("cameras")
    scale = 1 / context.scene.unit_settings.scale_length
    try:
        for camera in cameras:
            k, width, height = camera["intrinsics"], int(camera["width"]), int(camera["height"])
            matrix = rig_matrix(camera)
            data = bpy.data.cameras.new(str(camera["id"])[:60])
            data.sensor_fit = "HORIZONTAL"
            data.lens = float(k["fx"]) * data.sensor_width / width
            data.shift_x = 0.5 - float(k["cx"]) / width
            data.shift_y = (float(k["cy"]) - height / 2) / width
            data.display_size = 0.05 * scale
            found = bpy.data.objects.new(data.name, data)
            matrix.translation *= scale
            found.matrix_world = matrix
            collection.objects.link(found)
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        raise RaystageError(f"{file}: the rig cannot be used: {error}. Check it by `raystage info`.") from error


def run_raystage(*arguments: str) -> None:
    program = bpy.context.preferences.addons[__name__].preferences.program if __name__ in bpy.context.preferences.addons else ""
    program = program or os.environ.get("RAYSTAGE", "raystage")
    if shutil.which(program) is None:
        raise RaystageError(f"The program \"{program}\" was not found. Set its path in the preferences of this add-on.")
    try:
        subprocess.run([program, *arguments], check=True, capture_output=True, text=True, timeout=PROXY_SECONDS)
    except subprocess.TimeoutExpired as error:
        raise RaystageError(f"{program} {arguments[0]} took longer than {PROXY_SECONDS} s.") from error
    except subprocess.CalledProcessError as error:
        lines = error.stderr.strip().splitlines()
        raise RaystageError(lines[-1] if lines else f"{program} ended with exit code {error.returncode}.") from error


def read_proxy(file: pathlib.Path):
    """Returns what a file of `raystage proxy` holds (GLB: glTF 2.0, chapter 4): the origin, positions from it, triangles, texture coordinates, JPEG.

    Blender's own importer needs NumPy, in a version that some Linux distributions do not have.
    """
    try:
        data = file.read_bytes()
        magic, _version, _size, json_size, _kind = struct.unpack_from("<4s4I", data)
        if magic != b"glTF":
            raise ValueError("this is no GLB file")
        document = json.loads(data[20:20 + json_size])
        begin = 20 + json_size + 8

        def view(index: int) -> bytes:
            found = document["bufferViews"][index]
            at = begin + found["byteOffset"]
            return data[at:at + found["byteLength"]]

        def numbers(accessor: int, form: str) -> list[tuple]:
            return list(struct.iter_unpack(form, view(document["accessors"][accessor]["bufferView"])))
        primitive = document["meshes"][0]["primitives"][0]
        return (document["nodes"][0].get("translation", (0, 0, 0)), numbers(primitive["attributes"]["POSITION"], "<3f"),
                numbers(primitive["indices"], "<3I"), numbers(primitive["attributes"]["TEXCOORD_0"], "<2f"),
                view(document["images"][0]["bufferView"]))
    except (OSError, ValueError, KeyError, IndexError, TypeError, struct.error) as error:
        raise RaystageError(f"{file}: {error}") from error


def textured_material(name: str, image):
    """Returns a material that shows the colours of an image as they are."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    texture, emission, output = (nodes.new(kind) for kind in ("ShaderNodeTexImage", "ShaderNodeEmission", "ShaderNodeOutputMaterial"))
    texture.image = image
    emission.location, output.location = (300, 0), (500, 0)
    links.new(texture.outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs["Emission"], output.inputs["Surface"])
    return material


def add_take_proxy(context, take: pathlib.Path, collection, seconds: float) -> None:
    """Adds the surface that the middle of the array sees, by `raystage proxy`."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder, "proxy.glb")
        run_raystage("proxy", str(take), "-o", str(file), "--time", repr(seconds), "--quiet")
        origin, positions, triangles, coordinates, picture = read_proxy(file)
        texture = pathlib.Path(folder, f"{take.name} proxy.jpg")
        texture.write_bytes(picture)
        image = bpy.data.images.load(str(texture))
        image.pack()  # the file is temporary
    scale = 1 / context.scene.unit_settings.scale_length

    def in_blender(point) -> tuple:
        x, y, z = point
        return x * scale, -z * scale, y * scale
    mesh = bpy.data.meshes.new(f"{take.name} proxy")
    mesh.from_pydata([in_blender(position) for position in positions], [], triangles)
    layer = mesh.uv_layers.new()
    for loop in mesh.loops:
        u, v = coordinates[loop.vertex_index]
        layer.data[loop.index].uv = (u, 1 - v)  # Blender counts from below
    mesh.materials.append(textured_material(mesh.name, image))
    found = bpy.data.objects.new(mesh.name, mesh)
    found.location = in_blender(origin)
    found.hide_render = True  # for layout
    collection.objects.link(found)


# ---- Render to compositor ----

def read_exr_header(file: pathlib.Path) -> dict:
    """Returns the attributes of the first part of an EXR file that matter here: names to values (OpenEXR, "File Layout")."""
    try:
        with open(file, "rb") as stream:
            data = stream.read(MAX_HEADER_BYTES)
    except OSError as error:
        raise RaystageError(f"{file}: {error}") from error
    if len(data) < 8 or data[:4] != b"\x76\x2f\x31\x01":
        raise RaystageError(f"{file}: this is not an EXR file.")
    at = 8
    attributes = {}

    def text() -> str:
        nonlocal at
        end = data.index(b"\0", at, at + 256)
        result = data[at:end].decode("utf-8", "replace")
        at = end + 1
        return result

    try:
        while data[at] != 0:
            name, kind = text(), text()
            size, = struct.unpack_from("<i", data, at)
            at += 4
            if size < 0 or at + size > len(data):
                raise ValueError("an attribute exceeds the header")
            value = data[at:at + size]
            at += size
            if kind == "string":
                attributes[name] = value.decode("utf-8", "replace")
            elif kind == "stringvector":
                attributes[name] = value.decode("utf-8", "replace")  # whether there is one is what matters
            elif kind == "box2i" and size == 16:
                attributes[name] = struct.unpack("<4i", value)
            elif kind == "rational" and size == 8:
                attributes[name] = struct.unpack("<iI", value)
            elif kind == "chlist":
                attributes[name] = [channel.decode("utf-8", "replace") for channel in re.findall(rb"([^\0]+)\0.{16}", value, re.DOTALL)]
    except (ValueError, IndexError, struct.error) as error:
        raise RaystageError(f"{file}: the header is damaged: {error}.") from error
    return attributes


# Names of colour spaces in Blender's configs, the oldest last, by colorInteropID.
COLOR_SPACES = {
    "lin_rec709_scene": ("Linear Rec.709", "Linear"),
    "lin_ap1_scene": ("ACEScg", "Linear ACEScg"),
    "lin_ap0_scene": ("ACES2065-1", "Linear ACES"),
}


def set_color_space(image, interop_id: str) -> str:
    """Sets the colour space of an image. Returns a warning, or nothing."""
    for name in COLOR_SPACES.get(interop_id, ()):
        try:
            image.colorspace_settings.name = name
            return ""
        except TypeError:
            continue  # Blender has another config
    return f"Blender has no colour space for \"{interop_id}\": set the image's colour space by hand." if interop_id else ""


def sequence_frames(file: pathlib.Path) -> list[int]:
    """Returns the frame numbers of the sequence that a file belongs to: all files with another number as the last one."""
    match = re.fullmatch(r"(.*?)(\d+)(\D*)", file.name)
    if match is None:
        return []
    before, digits, after = match.groups()
    pattern = re.compile(re.escape(before) + r"(\d{" + str(len(digits)) + r",})" + re.escape(after))
    return sorted(int(m.group(1)) for m in map(pattern.fullmatch, (p.name for p in file.parent.iterdir())) if m)


def image_node(tree, image, label: str, frames: list[int]):
    """Adds a node that shows a sequence so that frame n of the scene shows file n."""
    node = tree.nodes.new("CompositorNodeImage")
    node.image = image
    node.label = label
    show_sequence(node, image, frames)
    return node


def show_sequence(node, image, frames: list[int]) -> None:
    if len(frames) <= 1:
        return
    image.source = "SEQUENCE"
    # Blender counts from the number of the file that was opened.
    node.frame_start = frames[0]
    node.frame_duration = frames[-1] - frames[0] + 1
    node.frame_offset = frames[0] - 1
    node.use_auto_refresh = True


def set_scene(scene, header: dict, frames: list[int]) -> None:
    """Gives the scene the range, size and rate of a render."""
    if len(frames) > 1:
        scene.frame_start, scene.frame_end = frames[0], frames[-1]
    if frames and not scene.frame_start <= scene.frame_current <= scene.frame_end:
        scene.frame_set(scene.frame_start)
    window = header.get("displayWindow")
    if window:
        scene.render.resolution_x, scene.render.resolution_y = window[2] - window[0] + 1, window[3] - window[1] + 1
        scene.render.resolution_percentage = 100
    numerator, denominator = header.get("framesPerSecond", (0, 0))
    if numerator > 0 and denominator > 0:
        fps = numerator / denominator
        scene.render.fps = max(1, round(fps))
        scene.render.fps_base = scene.render.fps / fps


def picture_output(node):
    """Returns the output with the picture: the first one of stereo files is another."""
    return node.outputs.get("Combined") or node.outputs.get("Image") or node.outputs[0]


def load_render(context, file: pathlib.Path) -> list[str]:
    """Loads a rendered sequence into the compositor: picture, depth, a Cryptomatte node, colour space. Returns warnings."""
    header = read_exr_header(file)
    frames = sequence_frames(file)
    scene = context.scene
    image = bpy.data.images.load(str(file), check_existing=True)
    space = header.get("colorInteropID", "")
    warnings = [set_color_space(image, space)]
    if header.get("view") or header.get("multiView"):
        scene.render.use_multiview = True  # before the node: it has the passes of both eyes then
    set_scene(scene, header, frames)
    if len(frames) > 1 and len(frames) != frames[-1] - frames[0] + 1:
        warnings.append(f"{frames[-1] - frames[0] + 1 - len(frames)} frames between {frames[0]} and {frames[-1]} are missing.")
    scene.use_nodes = True
    tree = scene.node_tree
    node = image_node(tree, image, file.name, frames)
    if space not in ("", "lin_rec709_scene"):
        # Blender converts every pass of three channels as if it was a colour: positions and normals are taken from an image of its own.
        data = bpy.data.images.load(str(file), check_existing=False)
        data.colorspace_settings.name = "Non-Color"
        passes = image_node(tree, data, f"{file.name}: P, N and other data", frames)
        passes.location = node.location[0], node.location[1] - 350
    if any(name.startswith("cryptomatte/") for name in header):
        matte = tree.nodes.new("CompositorNodeCryptomatteV2")
        matte.source = "IMAGE"
        matte.image = image
        show_sequence(matte, image, frames)
        matte.location = node.location[0] + 300, node.location[1] - 350
        tree.links.new(picture_output(node), matte.inputs[0])
    composite = next((n for n in tree.nodes if n.bl_idname == "CompositorNodeComposite"), None) or tree.nodes.new("CompositorNodeComposite")
    composite.location = node.location[0] + 600, node.location[1]
    tree.links.new(picture_output(node), composite.inputs["Image"])
    depth = node.outputs.get("Depth")
    if depth is not None and "Z" in composite.inputs:
        tree.links.new(depth, composite.inputs["Z"])
    tree.nodes.active = node
    return [warning for warning in warnings if warning]


# ---- Operators ----

class RaystageOperator:
    """Reports a RaystageError to the user."""

    def execute(self, context):
        try:
            return self.run(context)
        except RaystageError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}


class RAYSTAGE_OT_export_shot(RaystageOperator, bpy.types.Operator, bpy_extras.io_utils.ExportHelper):
    """Write the active camera, with all that animates it, to a Raystage shot. In an existing shot all else stays"""
    bl_idname = "raystage.export_shot"
    bl_label = "Export Raystage Shot"
    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})
    check_existing: bpy.props.BoolProperty(default=False, options={"HIDDEN"})  # existing shots are changed, not replaced
    take: bpy.props.StringProperty(name="Take", description="Folder of the take that a new shot shows", subtype="DIR_PATH")

    def run(self, context):
        keys = write_shot(context, pathlib.Path(self.filepath), self.take)
        self.report({"INFO"}, f"{self.filepath}: {keys} keys")
        return {"FINISHED"}


class RAYSTAGE_OT_import_take(RaystageOperator, bpy.types.Operator, bpy_extras.io_utils.ImportHelper):
    """Add the cameras of a Raystage take, and a proxy of its scene. Choose its take.json"""
    bl_idname = "raystage.import_take"
    bl_label = "Import Raystage Take"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})
    with_proxy: bpy.props.BoolProperty(name="Proxy of the scene", description="Estimate the scene's surfaces by `raystage proxy`", default=True)
    seconds: bpy.props.FloatProperty(name="Time", description="Time in the take, seconds", default=0, min=0)

    def run(self, context):
        take = pathlib.Path(self.filepath)
        take = take if take.is_dir() else take.parent
        if not (take / "take.json").is_file():
            raise RaystageError(f"{take}: this folder is not a take: take.json is missing. Choose the take.json of a take.")
        collection = bpy.data.collections.new(f"Raystage {take.name}")
        context.scene.collection.children.link(collection)
        try:
            add_take_cameras(context, take, collection)
            if self.with_proxy:
                add_take_proxy(context, take, collection, self.seconds)
        except Exception:
            remove_collection(collection)
            raise
        self.report({"INFO"}, f"{take}: {len(collection.objects)} objects")
        return {"FINISHED"}


class RAYSTAGE_OT_import_render(RaystageOperator, bpy.types.Operator, bpy_extras.io_utils.ImportHelper):
    """Load a sequence that Raystage rendered into the compositor. Choose one of its files"""
    bl_idname = "raystage.import_render"
    bl_label = "Import Raystage Render"
    filter_glob: bpy.props.StringProperty(default="*.exr", options={"HIDDEN"})

    def run(self, context):
        for warning in load_render(context, pathlib.Path(self.filepath)):
            self.report({"WARNING"}, warning)
        return {"FINISHED"}


class RaystagePreferences(bpy.types.AddonPreferences):
    bl_idname = __name__
    program: bpy.props.StringProperty(name="Program", description="Path of `raystage`; empty: found in PATH", subtype="FILE_PATH")

    def draw(self, _context):
        self.layout.prop(self, "program")


def draw_export(self, _context):
    self.layout.operator(RAYSTAGE_OT_export_shot.bl_idname, text="Raystage Shot (.json)")


def draw_import(self, _context):
    self.layout.operator(RAYSTAGE_OT_import_take.bl_idname, text="Raystage Take (take.json)")
    self.layout.operator(RAYSTAGE_OT_import_render.bl_idname, text="Raystage Render (.exr)")


CLASSES = (RAYSTAGE_OT_export_shot, RAYSTAGE_OT_import_take, RAYSTAGE_OT_import_render, RaystagePreferences)


def register():
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.TOPBAR_MT_file_export.append(draw_export)
    bpy.types.TOPBAR_MT_file_import.append(draw_import)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(draw_import)
    bpy.types.TOPBAR_MT_file_export.remove(draw_export)
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)


if __name__ == "__main__":
    register()
