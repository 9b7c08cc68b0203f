"""Render a look with Cycles, inside Blender's Python; `blender_compare.py` runs this.

python bench/materials/blender_render.py JOB.json
"""

from __future__ import annotations

import importlib
import json
import math
import sys
from pathlib import Path

import bpy
from mathutils import Matrix, Vector
from pxr import Usd

SOCKETS = (
    ("NodeSocketVector", "Tangent"),
    ("NodeSocketVector", "TowardsLight"),
    ("NodeSocketColor", "Irradiance"),
    ("NodeSocketInt", "Shadows"),
)
TO_Z_UP = Matrix.Rotation(math.pi / 2, 4, "X")


def main() -> None:
    jobs = json.loads(Path(sys.argv[1]).read_text())
    sys.path.insert(0, jobs[0]["addons"])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    importlib.import_module("fabricusd_looks").register()
    for job in jobs:
        render(job)


def render(job):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if job["material"] in ("principled", "lobes"):
        bpy.ops.import_scene.fabricusd(
            filepath=job["layer"], surface=job["material"].upper(), lights=False, cameras=False,
            subdivision=False,
        )  # fmt: skip
    else:
        bpy.ops.wm.usd_import(filepath=job["layer"], import_cameras=False, import_lights=False)
    for name, value in job.get("give", {}).items():
        for material in bpy.data.materials:
            for node in material.node_tree.nodes if material.node_tree else ():
                if name in node.inputs:
                    node.inputs[name].default_value = value
    if job["material"] == "osl":
        shade_by_osl(job)
    if job["light"] == "sky":
        world = importlib.import_module("fabricusd_looks.world")
        world.bring_dome(Usd.Stage.Open(job["scene"]), bpy.context.scene)
    else:
        add_light(job)
    add_camera(job)
    settings(job)
    bpy.ops.render.render(write_still=True)


def shade_by_osl(job):
    """Give every mesh the OSL shader with the parameters of the job."""
    material = bpy.data.materials.new("OSL")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    script = tree.nodes.new("ShaderNodeScript")
    script.mode = "EXTERNAL"
    script.filepath = compiled(job["shader"])
    # Blender creates the sockets with a module that the wheel lacks, so create the shader's here.
    for kind, name in SOCKETS:
        script.inputs.new(kind, name, identifier=name)
    script.outputs.new("NodeSocketShader", "Surface", identifier="Surface")
    towards = TO_Z_UP.to_3x3() @ Vector(job["towards_light"])
    script.inputs["TowardsLight"].default_value = towards
    script.inputs["Irradiance"].default_value = (*(3 * [job["irradiance"]]), 1.0)
    script.inputs["Shadows"].default_value = 8
    tangent = tree.nodes.new("ShaderNodeTangent")
    tangent.direction_type, tangent.uv_map = "UV_MAP", "st"
    tree.links.new(tangent.outputs[0], script.inputs["Tangent"])
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(script.outputs[0], output.inputs["Surface"])
    for one in bpy.data.objects:
        if one.type == "MESH":
            one.data.materials.clear()
            one.data.materials.append(material)


def compiled(source):
    """The shader, compiled by the oslc that is part of Cycles."""
    import _cycles

    target = str(Path(source).with_suffix(".oso"))
    if not _cycles.osl_compile(source, target):
        raise SystemExit(f"oslc refuses {source}")
    return target


def add_light(job):
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy = job["irradiance"]
    sun.angle = 0.0
    one = bpy.data.objects.new("Sun", sun)
    towards = TO_Z_UP.to_3x3() @ Vector(job["towards_light"])
    one.rotation_euler = towards.to_track_quat("Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(one)


def add_camera(job):
    camera = bpy.data.cameras.new("Camera")
    camera.lens, camera.sensor_width, camera.sensor_fit = job["focal_length"], 36.0, "HORIZONTAL"
    camera.clip_start, camera.clip_end = job.get("clip", 0.01), 1e5
    one = bpy.data.objects.new("Camera", camera)
    # USD's matrices apply to row vectors.
    one.matrix_world = TO_Z_UP @ Matrix(job["camera"]).transposed()
    bpy.context.scene.collection.objects.link(one)
    bpy.context.scene.camera = one


def settings(job):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.shading_system = job["material"] == "osl"
    scene.cycles.samples = job["spp"]
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = job["bounces"]
    for kind in ("diffuse", "glossy", "transmission"):
        setattr(scene.cycles, f"{kind}_bounces", job["bounces"])
    scene.cycles.sample_clamp_indirect = 0.0
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.film_transparent = True
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 2
    scene.render.resolution_x, scene.render.resolution_y = job["size"]
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = job["picture"]


main()
