# SPDX-License-Identifier: Apache-2.0
"""Runs in Blender: uses the add-on as an artist does, and prints what Blender sees as "RESULT " and JSON.

    blender -b --factory-startup -P addon_scene.py -- ADDON.py TASK ARGUMENT...
"""
import importlib.util
import json
import sys

import bpy
import mathutils
from bpy_extras.object_utils import world_to_camera_view

FIRST, LAST = 1001, 1012
SIZE = (320, 180)
addon_file, task, *arguments = sys.argv[sys.argv.index("--") + 1:]
spec = importlib.util.spec_from_file_location("raystage_blender", addon_file)
addon = importlib.util.module_from_spec(spec)
sys.modules["raystage_blender"] = addon
spec.loader.exec_module(addon)
addon.register()
scene = bpy.context.scene


def answer(value) -> None:
    print("RESULT " + json.dumps(value))


def clear() -> None:
    for found in list(bpy.data.objects):
        bpy.data.objects.remove(found)


def add(name: str, data=None):
    found = bpy.data.objects.new(name, data)
    scene.collection.objects.link(found)
    return found


def build(zooms: bool = True, fit: str = "AUTO", tracks: bool = True) -> None:
    """A cube, and a camera on a turning crane; by default it looks at a moving target through a constraint, with a zoom and a shift."""
    clear()
    scene.render.fps, scene.render.fps_base = 24, 1.001
    scene.frame_start, scene.frame_end = FIRST, LAST
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0.1, 0.3, 0.2), rotation=(0.3, 0.2, 0.5))
    camera = add("shot camera", bpy.data.cameras.new("shot camera"))
    crane, target = add("crane"), add("target")
    crane.location = (0, -1, 0.5)
    camera.parent = crane
    camera.location = (0.2, -3, 0.4)
    if tracks:
        constraint = camera.constraints.new("TRACK_TO")
        constraint.target, constraint.track_axis, constraint.up_axis = target, "TRACK_NEGATIVE_Z", "UP_Y"
    else:  # what Blender's exporter of glTF keeps
        camera.rotation_euler = (1.5, 0, 0)
    for frame, turn, point, lens, shift in ((FIRST, -0.3, (0, 0, 0), 40, 0), (LAST, 0.4, (0.2, 0, 0.3), 62 if zooms else 40, 0.12)):
        crane.rotation_euler.z = turn
        crane.keyframe_insert("rotation_euler", frame=frame)
        target.location = point
        target.keyframe_insert("location", frame=frame)
        camera.data.lens = lens
        camera.data.keyframe_insert("lens", frame=frame)
        if zooms:
            camera.data.shift_x = shift
            camera.data.shift_y = -shift / 2
            camera.data.keyframe_insert("shift_x", frame=frame)
            camera.data.keyframe_insert("shift_y", frame=frame)
    camera.data.sensor_fit = fit
    camera.data.dof.use_dof = True
    camera.data.dof.focus_object = target
    camera.data.dof.aperture_fstop = 2.8
    scene.camera = camera


def cube():
    return next(found for found in bpy.data.objects if found.type == "MESH")


def corners() -> list:
    return [cube().matrix_world @ mathutils.Vector(corner) for corner in cube().bound_box]


def seen(camera) -> dict:
    """Returns for each frame the pixels of the cube's corners, right and down from the upper left."""
    pixels = {}
    for frame in range(FIRST, LAST + 1):
        scene.frame_set(frame)
        bpy.context.view_layer.update()
        pixels[frame] = [[v.x * SIZE[0], (1 - v.y) * SIZE[1]] for v in (world_to_camera_view(scene, camera, p) for p in corners())]
    return pixels


def raystage_points() -> list:
    """Returns the corners in Raystage's world."""
    return [[p.x, p.z, -p.y] for p in corners()]


def export_shot(shot: str, fit: str) -> None:
    build(fit=fit)
    result = {"pixels": seen(scene.camera), "points": raystage_points()}
    scene.frame_set(FIRST + 3)
    bpy.ops.raystage.export_shot(filepath=shot)
    result["frame"] = scene.frame_current
    answer(result)


def export_gltf(file: str) -> None:
    build(zooms=False, tracks=False)
    bpy.ops.export_scene.gltf(filepath=file, export_cameras=True, export_apply=True)
    answer({"pixels": seen(scene.camera), "points": raystage_points()})


def import_gltf(file: str) -> None:
    build(zooms=False)
    points = raystage_points()
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=file)
    camera = next(o for o in set(bpy.data.objects) - before if o.type == "CAMERA")
    answer({"pixels": seen(camera), "points": points})


def render_cycles(picture: str) -> None:
    scene.camera.data.dof.use_dof = False  # silhouettes
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 16
    scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 1
    scene.render.film_transparent = True
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = picture
    bpy.ops.render.render(animation=True)


def render_cube(shot: str, mesh: str, picture: str) -> None:
    build()
    bpy.ops.object.select_all(action="DESELECT")
    cube().select_set(True)
    bpy.ops.export_scene.gltf(filepath=mesh, use_selection=True)
    bpy.ops.raystage.export_shot(filepath=shot)
    scene.render.image_settings.file_format = "OPEN_EXR"
    render_cycles(picture)
    answer({})


def render_materials(shot: str, gltf: str, fbx: str, picture: str) -> None:
    """Exports and renders a cube that turns and moves with its parent, of a packed texture and a plain material."""
    build()
    scene.frame_end = FIRST + 4
    box = cube()
    picture_of_wood = bpy.data.images.new("wood", 64, 64)
    codes = ((1.0, 0.2, 0.1, 1.0), (0.1, 0.3, 1.0, 1.0), (0.9, 0.9, 0.2, 1.0))
    picture_of_wood.pixels = [value for y in range(64) for x in range(64) for value in codes[(x // 16 + 2 * (y // 32)) % 3]]
    picture_of_wood.pack()
    wood, plain = bpy.data.materials.new("wood"), bpy.data.materials.new("plain")
    for material in (wood, plain):
        material.use_nodes = True
        box.data.materials.append(material)
    texture = wood.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = picture_of_wood
    wood.node_tree.links.new(texture.outputs[0], wood.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    plain.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.1, 0.8, 0.2, 1)
    for index, polygon in enumerate(box.data.polygons):
        polygon.material_index = index % 2
    pivot = add("pivot")
    box.parent = pivot
    for frame, turn, z in ((FIRST, 0, 0.2), (FIRST + 4, 0.8, 0.4)):
        pivot.rotation_euler.z = turn
        pivot.keyframe_insert("rotation_euler", frame=frame)
        box.location.z = z
        box.keyframe_insert("location", frame=frame)
    bpy.ops.object.select_all(action="DESELECT")
    for found in (box, pivot):
        found.select_set(True)
    bpy.ops.export_scene.gltf(filepath=gltf, use_selection=True)
    scene.frame_set(FIRST)
    bpy.ops.export_scene.fbx(filepath=fbx, use_selection=True, path_mode="COPY", embed_textures=True, bake_anim=False)
    bpy.ops.raystage.export_shot(filepath=shot)
    bpy.context.view_layer.use_pass_diffuse_color = True
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render_cycles(picture)
    answer({})


def compare_colors(first: str, second: str) -> None:
    """Returns the number of pixels that both show whole, and the share of them with another colour."""
    import numpy

    def values(file):
        image = bpy.data.images.load(file)
        image.colorspace_settings.name = "Non-Color"
        return numpy.array(image.pixels[:], dtype=numpy.float32).reshape(image.size[1], image.size[0], 4)
    a, b = values(first), values(second)
    both = (a[..., 3] > 0.999) & (b[..., 3] > 0.999)
    # Between texels, Blender blends the codes of an image and Raystage its light.
    other = numpy.abs(a[..., :3] - b[..., :3]).max(axis=2) > 0.25
    answer({"pixels": int(both.sum()), "other": float((other & both).sum() / max(1, both.sum()))})


def mask(file: str):
    import numpy
    image = bpy.data.images.load(file)
    values = numpy.array(image.pixels[:], dtype=numpy.float32).reshape(image.size[1], image.size[0], image.channels)
    return values[..., 3] >= 0.5


def compare_masks(first: str, second: str) -> None:
    """Returns pixels of each silhouette, and how many are more than a pixel away from the other one."""
    import numpy

    def grown(inside):
        padded = numpy.pad(inside, 1)
        return sum(padded[1 + y:1 + y + inside.shape[0], 1 + x:1 + x + inside.shape[1]]
                   for y in (-1, 0, 1) for x in (-1, 0, 1)) > 0
    a, b = mask(first), mask(second)
    answer({"inside": [int(a.sum()), int(b.sum())], "outside": int((a & ~grown(b)).sum() + (b & ~grown(a)).sum())})


def import_take(take: str, point: str) -> None:
    clear()
    bpy.ops.raystage.import_take(filepath=take + "/take.json", with_proxy=True)
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    x, y, z = json.loads(point)
    pixels = {}
    for found in bpy.data.objects:
        if found.type == "CAMERA":
            view = world_to_camera_view(scene, found, mathutils.Vector((x, -z, y)))
            pixels[found.name] = [view.x * 160, (1 - view.y) * 120]
    meshes = [found for found in bpy.data.objects if found.type == "MESH"]
    corners_of_mesh = [meshes[0].matrix_world @ vertex.co for vertex in meshes[0].data.vertices]
    answer({"pixels": pixels, "triangles": [len(found.data.polygons) for found in meshes],
            "middle_depth": sorted(p.y for p in corners_of_mesh)[len(corners_of_mesh) // 2], "origin": list(meshes[0].location),
            "depths": len({round(vertex.co.y, 4) for vertex in meshes[0].data.vertices}),
            "collections": [c.name for c in scene.collection.children]})


def failed_import(take: str) -> None:
    """Returns the messages of imports that fail, and what they leave."""
    clear()
    messages = []
    for file, seconds in ((take + "/take.json", 50), (take + "/archive/take.json", 0)):
        try:
            bpy.ops.raystage.import_take(filepath=file, seconds=seconds)
        except RuntimeError as error:
            messages.append(str(error))
    answer({"messages": messages, "objects": len(bpy.data.objects), "cameras": len(bpy.data.cameras),
            "collections": [c.name for c in scene.collection.children]})


def export_stereo(shot: str, pivot: str) -> None:
    """Writes the stereo of a scene. Returns what the eye at the pivot sees, which is the camera, and why toed-in cameras are refused."""
    build()
    scene.render.use_multiview = True
    stereo = scene.camera.data.stereo
    stereo.interocular_distance, stereo.convergence_distance, stereo.convergence_mode = 0.12, 3, "OFFAXIS"
    stereo.pivot = pivot
    bpy.ops.raystage.export_shot(filepath=shot)
    result = {"pixels": seen(scene.camera), "points": raystage_points()}
    stereo.convergence_mode = "TOE"
    message = ""
    try:
        bpy.ops.raystage.export_shot(filepath=shot)
    except RuntimeError as error:
        message = str(error)
    answer({**result, "message": message})


def import_render(file: str, picture: str, frame: str) -> None:
    clear()
    scene.camera = add("camera", bpy.data.cameras.new("camera"))  # Blender renders nothing without one
    bpy.ops.raystage.import_render(filepath=file)
    nodes = {node.bl_idname: node for node in scene.node_tree.nodes}
    images = [node for node in scene.node_tree.nodes if node.bl_idname == "CompositorNodeImage"]
    source = images[0]
    matte = nodes.get("CompositorNodeCryptomatteV2")
    composite = nodes["CompositorNodeComposite"]
    result = {
        "space": source.image.colorspace_settings.name, "duration": source.frame_duration, "start": source.frame_start,
        "range": [scene.frame_start, scene.frame_end], "size": [scene.render.resolution_x, scene.render.resolution_y],
        "fps": scene.render.fps / scene.render.fps_base, "matte": matte is not None,
        "depth": composite.inputs["Z"].is_linked, "multiview": scene.render.use_multiview, "current": scene.frame_current,
        "picture": composite.inputs["Image"].links[0].from_socket.name, "spaces": [n.image.colorspace_settings.name for n in images],
    }
    scene.frame_set(int(frame))
    # Positions and normals as an artist takes them: from the last node.
    passes = scene.node_tree.nodes.new("CompositorNodeOutputFile")
    passes.base_path = picture + ".passes"
    passes.format.file_format, passes.format.color_depth = "OPEN_EXR", "32"
    passes.file_slots.clear()
    for name in ("P", "N"):
        if name in images[-1].outputs:
            passes.file_slots.new(name)
            scene.node_tree.links.new(images[-1].outputs[name], passes.inputs[name])
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = picture
    bpy.ops.render.render(write_still=True)
    answer(result)


{"export_shot": export_shot, "export_gltf": export_gltf, "import_gltf": import_gltf, "render_cube": render_cube,
 "render_materials": render_materials, "compare_colors": compare_colors,
 "compare_masks": compare_masks, "import_take": import_take, "failed_import": failed_import, "export_stereo": export_stereo, "import_render": import_render}[task](*arguments)
