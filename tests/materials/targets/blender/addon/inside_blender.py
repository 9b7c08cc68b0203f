"""Steps that tests run in Blender's Python: python inside_blender.py JOB.json ANSWER.json.

A step is a dictionary whose `do` names a function here; the others are its arguments.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path

import bpy
from mathutils import Matrix, Vector


def main() -> None:
    job = json.loads(Path(sys.argv[1]).read_text())
    sys.path.insert(0, job["addons"])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    importlib.import_module("fabricusd_looks").register()
    answers = [globals()[one.pop("do")](**one) for one in job["steps"]]
    Path(sys.argv[2]).write_text(json.dumps(answers))
    sys.stdout.flush()
    # Blender 4.5 as a module may wait for ever when Python ends.
    os._exit(0)


def clear():
    """An empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)


def bring(path, **options):
    """Import a look; the error if it is refused."""
    try:
        return {"done": list(bpy.ops.import_scene.fabricusd(filepath=path, **options))}
    except RuntimeError as error:
        return {"error": str(error).strip()}


def without_usd():
    """As in a Blender that was built without USD."""
    importlib.import_module("fabricusd_looks.operator").HAS_USD = False


def said():
    """What imports have reported: all that Blender printed."""
    sys.stdout.flush()
    return Path(os.environ["SAID"]).read_text()


def install(package):
    """Install the add-on as a user does; the names of its modules that are then enabled."""
    importlib.import_module("fabricusd_looks").unregister()
    bpy.ops.preferences.addon_enable(module="bl_pkg")
    bpy.ops.extensions.package_install_files(
        filepath=package, repo="user_default", enable_on_install=True
    )
    return [one.module for one in bpy.context.preferences.addons if "fabricusd" in one.module]


def counts():
    kinds = ("materials", "node_groups", "images", "objects", "worlds")
    return {kind: len(getattr(bpy.data, kind)) for kind in kinds}


def undo(times=1):
    for _ in range(times):
        bpy.ops.ed.undo()
    return counts()


def redo():
    bpy.ops.ed.redo()
    return counts()


def push(message):
    bpy.ops.ed.undo_push(message=message)


def groups():
    """Every group and every material as text: nodes, constants, links, textures."""
    found = {}
    for one in bpy.data.node_groups:
        found[f"group {one.name}"] = tree(one)
    for one in bpy.data.materials:
        found[f"material {one.name}"] = tree(one.node_tree)
    return found


def tree(one):
    nodes = [
        [
            n.bl_idname,
            n.name,
            getattr(n, "operation", ""),
            picture(n),
            [constant(i) for i in n.inputs],
        ]
        for n in one.nodes
    ]
    links = [
        [k.from_node.name, k.from_socket.name, k.to_node.name, k.to_socket.name] for k in one.links
    ]
    return [nodes, sorted(links)]


def picture(node):
    image = getattr(node, "image", None)
    if image is None:
        return None
    name = Path(bpy.path.abspath(image.filepath)).name
    pixels = list(image.pixels[:64])
    tiles = [tile.number for tile in image.tiles] if image.source == "TILED" else []
    return [name, image.colorspace_settings.name, tiles, pixels, list(image.size)]


def constant(socket):
    value = getattr(socket, "default_value", None)
    return list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def change(material, **inputs):
    """Set inputs of a material's group by their names."""
    nodes = bpy.data.materials[material].node_tree.nodes
    group = next(n for n in nodes if n.bl_idname == "ShaderNodeGroup")
    for name, value in inputs.items():
        group.inputs[name].default_value = value


def from_above(picture, cells, towards_light, irradiance, size, transparent=False):
    """Render a sheet of `cells` x `cells` unit squares from above, in a sun without bounces.

    transparent : whether the picture is where nothing is behind the sheet's gaps
    """
    scene = bpy.context.scene
    scene.render.film_transparent = transparent
    for one in bpy.data.objects:
        one.visible_shadow = False
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = irradiance, 0.0
    lamp = bpy.data.objects.new("Sun", sun)
    lamp.rotation_euler = Vector(towards_light).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(lamp)
    camera = bpy.data.cameras.new("Above")
    camera.type, camera.ortho_scale = "ORTHO", cells
    eye = bpy.data.objects.new("Above", camera)
    eye.matrix_world = Matrix.Translation((0.5 * cells, 0.5 * cells, 10.0))
    scene.collection.objects.link(eye)
    scene.camera = eye
    scene.cycles.max_bounces = 0
    render(picture, size, 1)


def give(name, value):
    """Set an input of the groups of all materials; the number of those that have it."""
    nodes = [node for one in bpy.data.materials for node in one.node_tree.nodes]
    mine = [node.inputs[name] for node in nodes if name in node.inputs]
    for socket in mine:
        socket.default_value = value
    return len(mine)


def inputs_named(name):
    """The value of an input, by the names of the materials whose group has it."""
    found = {}
    for one in bpy.data.materials:
        for node in one.node_tree.nodes:
            if name in node.inputs:
                found[one.name] = node.inputs[name].default_value
    return found


def pixel(camera, size, percentage=100):
    """What the drivers make of a camera: the width of a pixel for 1 m of distance, and beside."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("Eye")
    for name, value in camera.items():
        setattr(data, name, value)
    scene.camera = bpy.data.objects.new("Eye", data)
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = percentage
    seen = bpy.context.evaluated_depsgraph_get()
    seen.update()
    tree = next(one for one in bpy.data.node_groups if one.get("fabricusd_pixel"))
    nodes = tree.evaluated_get(seen).nodes
    return [n.outputs[0].default_value for n in nodes if n.bl_idname == "ShaderNodeValue"]


def texel_levels(path, folder):
    """The mean of an image where a pixel spans 1, 2, 4 ... texels, with the texture cache on."""
    clear()
    scene = bpy.context.scene
    cached = hasattr(scene.render, "use_texture_cache")
    if cached:
        scene.render.use_texture_cache = scene.render.use_auto_generate_texture_cache = True
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    sheet = bpy.data.meshes.new("Sheet")
    corners = [(-64, -64, 0), (64, -64, 0), (64, 64, 0), (-64, 64, 0)]
    sheet.from_pydata(corners, [], [(0, 1, 2, 3)])
    for corner, at in zip(sheet.uv_layers.new(name="st").data, corners, strict=True):
        corner.uv = at[:2]
    material = bpy.data.materials.new("Shown")
    if material.node_tree is None:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    read, glow = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeEmission")
    read.image = image
    links.new(nodes.new("ShaderNodeUVMap").outputs[0], read.inputs[0])
    links.new(read.outputs[0], glow.inputs[0])
    links.new(glow.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
    sheet.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("Sheet", sheet))
    camera = bpy.data.cameras.new("Above")
    camera.type = "ORTHO"
    scene.camera = bpy.data.objects.new("Above", camera)
    scene.camera.location = (0.013, 0.017, 5.0)
    scene.collection.objects.link(scene.camera)
    found, side = [], 8
    for level in range(image.size[0].bit_length()):
        camera.ortho_scale = side * 2.0**level / image.size[0]
        picture = str(Path(folder) / f"level{level}.exr")
        render(picture, (side, side), 4)
        shown = bpy.data.images.load(picture)
        found.append(sum(list(shown.pixels)[::4]) / side**2)
    return {"cached": cached, "means": found}


def sheen_by_view(picture, normal, views):
    """The radiance of a sheet of sheen alone, whose texture says `normal`, in an even sky of 1."""
    clear()
    scene = bpy.context.scene
    known = importlib.import_module("fabricusd_looks.looks")
    make = importlib.import_module("fabricusd_looks.principled").principled
    values = {
        "base_color_scale": (0.0,) * 3, "specular_ior": 1.0, "specular_tint": (0.0,) * 3,
        "smooth_scale": 1.0, "rough_scale": 1.0, "fuzz_weight": 1.0, "fuzz_color": (1.0,) * 3,
        "fuzz_roughness": 0.3,
    }  # fmt: skip
    code = [0.5 * x + 0.5 for x in normal]
    one = known.Look(
        path="", name="Pile", fabric="", values=values, maps={"normal": ""},
        constants={"normal": code}, transparent=False, mixture=None,
    )  # fmt: skip
    material = bpy.data.materials.new("Pile")
    if material.node_tree is None:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    group = nodes.new("ShaderNodeGroup")
    group.node_tree = make(one, "Pile")
    links.new(group.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
    material.cycles.use_bump_map_correction = False
    sheet = bpy.data.meshes.new("Sheet")
    corners = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
    sheet.from_pydata(corners, [], [(0, 1, 2, 3)])
    for corner, at in zip(sheet.uv_layers.new(name="st").data, corners, strict=True):
        corner.uv = at[:2]
    sheet.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("Sheet", sheet))
    scene.world = bpy.data.worlds.new("Even")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (1.0, 1.0, 1.0, 1.0)
    scene.cycles.max_bounces = 0
    scene.camera = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    scene.camera.data.lens = 5000.0
    scene.collection.objects.link(scene.camera)
    found = []
    for k, view in enumerate(views):
        scene.camera.location = Vector(view) * 5.0
        scene.camera.rotation_euler = Vector(view).to_track_quat("Z", "Y").to_euler()
        name = picture.replace("*", str(k))
        render(name, (4, 4), 64)
        found.append(sum(list(bpy.data.images.load(name).pixels)[1::4]) / 16)
    return found


def look(picture, size, spp):
    """Render through the camera that was imported."""
    scene = bpy.context.scene
    scene.camera = scene.camera or next(o for o in bpy.data.objects if o.type == "CAMERA")
    render(picture, size, spp)


def render(picture, size, spp):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", spp
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_indirect = 0.0
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = picture
    bpy.ops.render.render(write_still=True)


main()
