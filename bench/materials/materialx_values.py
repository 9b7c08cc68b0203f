"""Record the values of MaterialX's own shaders, for `tests/materials/test_models.py`.

    python bench/materials/materialx_values.py tests/materials/materialx_values.json

Generates GLSL with MaterialX, runs it on one pixel per pair of directions under one distant light,
and writes the values. Needs PyPI `materialx` and `moderngl`, and EGL (Mesa's llvmpipe is enough).
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import MaterialX as mx
import moderngl
import numpy as np
from MaterialX import PyMaterialXGenGlsl, PyMaterialXGenShader

PAIRS = 24

SURFACES = [
    {
        "base": [0.5, 0.3, 0.1], "ior": 1.6, "tint": [1.0, 0.8, 0.6], "rough": 0.5, "smooth": 0.2,
        "fuzz_weight": 0.0, "fuzz_color": [1.0, 0.9, 0.5], "fuzz_roughness": 0.4,
    },
    {
        "base": [0.1, 0.3, 0.6], "ior": 3.0, "tint": [0.3, 0.4, 0.5], "rough": 0.8, "smooth": 0.6,
        "fuzz_weight": 0.6, "fuzz_color": [1.0, 0.9, 0.5], "fuzz_roughness": 0.3,
    },
]  # fmt: skip


def inputs_of(kind, s):
    """The category of the node, and its inputs, with roughness as that node parameterises it."""
    ratio = s["smooth"] / s["rough"]
    if kind == "openpbr":
        mean = (0.5 * (s["rough"] ** 2 + s["smooth"] ** 2)) ** 0.25
        return "open_pbr_surface", {
            "base_color": s["base"], "specular_ior": s["ior"], "specular_color": s["tint"],
            "specular_roughness": mean, "specular_roughness_anisotropy": 1.0 - ratio,
            "fuzz_weight": s["fuzz_weight"], "fuzz_color": s["fuzz_color"],
            "fuzz_roughness": s["fuzz_roughness"],
        }  # fmt: skip
    if kind == "standard_surface":
        return "standard_surface", {
            "base": 1.0, "base_color": s["base"], "specular_IOR": s["ior"],
            "specular_color": s["tint"], "sheen": s["fuzz_weight"],
            "specular_roughness": (s["rough"] * s["smooth"]) ** 0.25,
            "specular_anisotropy": 1.0 - ratio, "sheen_color": s["fuzz_color"],
            "sheen_roughness": s["fuzz_roughness"],
        }  # fmt: skip
    if kind == "gltf_pbr":
        strength = ((s["rough"] - s["smooth"]) / (1.0 - s["smooth"])) ** 0.5
        return "gltf_pbr", {
            "base_color": s["base"], "metallic": 0.0, "ior": s["ior"], "specular_color": s["tint"],
            "roughness": s["smooth"] ** 0.5, "anisotropy_strength": strength,
            "sheen_color": [c * s["fuzz_weight"] for c in s["fuzz_color"]],
            "sheen_roughness": s["fuzz_roughness"],
        }  # fmt: skip
    return "UsdPreviewSurface", {
        "diffuseColor": s["base"], "metallic": 0.0, "ior": s["ior"],
        "roughness": s["smooth"] ** 0.5,
    }  # fmt: skip


def with_library():
    """A document that holds MaterialX's own definitions."""
    document = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), document)
    return document


def shaders(category, inputs):
    """Vertex and fragment shader of one surface node."""
    document = with_library()
    node = document.addNode(category, "shown", "surfaceshader")
    for name, value in inputs.items():
        if isinstance(value, list):
            node.setInputValue(name, mx.Color3(*value), "color3")
        else:
            node.setInputValue(name, value, "float")
    document.addMaterialNode("shown_material", node)
    return generated(document, node)


def generated(document, node):
    """Vertex and fragment shader of a surface under a directional light, without a sky."""
    search = mx.getDefaultDataSearchPath()
    generator = PyMaterialXGenGlsl.GlslShaderGenerator.create()
    context = PyMaterialXGenShader.GenContext(generator)
    context.registerSourceCodeSearchPath(search)
    options = context.getOptions()
    none = PyMaterialXGenShader.HwSpecularEnvironmentMethod.SPECULAR_ENVIRONMENT_NONE
    options.hwSpecularEnvironmentMethod, options.hwMaxActiveLightSources = none, 1
    light = document.getNodeDef("ND_directional_light")
    PyMaterialXGenShader.HwShaderGenerator.bindLightShader(light, 1, context)
    made = generator.generate("shown", node, context)
    # Without an environment, the generator does not declare this one.
    missing = "uniform bool u_refractionTwoSided = false;\nuniform int u_numActive"
    fragment = made.getSourceCode("pixel").replace("uniform int u_numActive", missing, 1)
    return made.getSourceCode("vertex"), fragment


def evaluate(kind, surface, wi, wo):
    """(n, 3) values of the shader on a plane at the origin, x along the tangent."""
    return values_of(*shaders(*inputs_of(kind, surface)), wi, wo)


def values_of(vertex, fragment, wi, wo, textures=None):
    """(n, 3) values of a shader on a plane at the origin, x along the tangent.

    textures : the one texel, up to four numbers, of each sampler whose name starts with the key
    """
    context = moderngl.create_standalone_context(backend="egl")
    program = context.program(vertex_shader=vertex, fragment_shader=fragment)
    for name in ("u_worldMatrix", "u_viewProjectionMatrix", "u_worldInverseTransposeMatrix"):
        if name in program:
            program[name].write(np.eye(4, dtype="f4").tobytes())
    corners = {
        "i_position": [[-1, -1, 0], [3, -1, 0], [-1, 3, 0]],
        "i_normal": [[0, 0, 1]] * 3,
        "i_tangent": [[1, 0, 0]] * 3,
        "i_texcoord_0": [[0.5, 0.5]] * 3,
    }
    buffers = [
        (context.buffer(np.array(v, "f4").tobytes()), f"{len(v[0])}f", k)
        for k, v in corners.items()
        if k in program
    ]
    triangle = context.vertex_array(program, buffers)
    target = context.simple_framebuffer((1, 1), components=4, dtype="f4")
    target.use()
    for place, (name, texel) in enumerate((textures or {}).items()):
        (sampler,) = (one for one in program if one.startswith(f"{name}_file"))
        held = np.array(texel, "f4")
        context.texture((1, 1), len(held), held.tobytes(), dtype="f4").use(place)
        program[sampler] = place
    program["u_numActiveLightSources"] = 1
    program["u_lightData[0].type"] = 1
    program["u_lightData[0].color"] = (1.0, 1.0, 1.0)
    program["u_lightData[0].intensity"] = 1.0
    found = []
    for i, o in zip(wi, wo, strict=True):
        program["u_viewPosition"] = tuple(1e4 * o)
        program["u_lightData[0].direction"] = tuple(-i)
        target.clear()
        triangle.render(moderngl.TRIANGLES)
        found.append(np.frombuffer(target.read(components=4, dtype="f4"), "f4")[:3].tolist())
    return found


def main() -> None:
    w = np.random.default_rng(3).normal(size=(2, PAIRS, 3))
    w[..., 2] = np.abs(w[..., 2]) + 0.1
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    w = np.round(w, 6)
    kinds = ("openpbr", "standard_surface", "gltf_pbr", "preview")
    rows = [
        {"kind": kind, "surface": surface, "values": evaluate(kind, surface, *w)}
        for kind in kinds
        for surface in SURFACES
    ]
    said = {"materialx": mx.__version__, "wi": w[0].tolist(), "wo": w[1].tolist(), "rows": rows}
    Path(sys.argv[1]).write_text(json.dumps(said) + "\n")


if __name__ == "__main__":
    main()
