# SPDX-License-Identifier: Apache-2.0
"""Runs in Blender: writes the passes of an EXR file, as the compositor sees them, as EXR files of floats.

    blender -b --factory-startup -P read_passes.py -- FILE.exr FOLDER WIDTH HEIGHT [OBJECT...]

Pass n becomes FOLDER/n_0001.exr. OBJECT: picked by the Cryptomatte node, written as OBJECT m in FOLDER/object_m_0001.exr.
With a pass `motion` the picture, blurred by it, is FOLDER/blurred_0001.exr (Vector Blur, shutter of one frame).
Prints "PASSES " and a JSON object.
"""
import json
import re
import sys

import bpy

source, folder, width, height, *objects = sys.argv[sys.argv.index("--") + 1:]
scene = bpy.context.scene
scene.use_nodes = True
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = int(width), int(height), 100
nodes, links = scene.node_tree.nodes, scene.node_tree.links
nodes.clear()


def write(socket, name: str) -> None:
    output = nodes.new("CompositorNodeOutputFile")
    output.base_path = folder
    output.format.file_format = "OPEN_EXR"
    output.format.color_depth = "32"
    output.format.color_mode = "RGBA"
    output.format.exr_codec = "NONE"
    output.file_slots[0].path = name + "_"
    links.new(socket, output.inputs[0])


image = bpy.data.images.load(source)
first = nodes.new("CompositorNodeImage")
first.image = image
names = [None]
if first.has_layers:
    try:
        first.layer = "?"  # the refusal lists the layers
    except TypeError as error:
        names = re.findall(r"'([^']*)'", str(error).split("not found in")[1])
passes = []
for name in names:
    node = nodes.new("CompositorNodeImage")
    node.image = image
    if name is not None:
        node.layer = name
    for socket in node.outputs:
        if socket.enabled:
            write(socket, str(len(passes)))
            passes.append([name or "", socket.name])
named = {socket.name: socket for node in nodes if node.bl_idname == "CompositorNodeImage" for socket in node.outputs if socket.enabled}
if "motion" in named:
    blur = nodes.new("CompositorNodeVecBlur")
    blur.samples, blur.factor, blur.use_curved = 64, 1, False
    links.new(named["Combined"], blur.inputs["Image"])
    links.new(named["Depth"], blur.inputs["Z"])
    links.new(named["motion"], blur.inputs["Speed"])
    write(blur.outputs["Image"], "blurred")
for number, picked in enumerate(objects):
    matte = nodes.new("CompositorNodeCryptomatteV2")
    matte.source = "IMAGE"
    matte.image = image
    matte.matte_id = picked
    write(matte.outputs["Matte"], f"object_{number}")
composite = nodes.new("CompositorNodeComposite")
links.new(first.outputs[0], composite.inputs[0])
bpy.ops.render.render()
print("PASSES " + json.dumps({"type": image.type, "passes": passes}))
