"""The shading network of a mixture, against the mixture and against MaterialX's own shaders."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from materials.lobes.mixtures import LEVEL, directions, mixture

from fabricusd.materials.fit.models import sheen_value
from fabricusd.materials.lobes.known import from_dict
from fabricusd.materials.lobes.mixture import MATERIALX, evaluate, reflected
from fabricusd.materials.lobes.network import LOBE, lobes
from fabricusd.materials.networks.graph import Link, Value, unrolled
from fabricusd.materials.networks.surfaces import GRAPHS
from fabricusd.materials.targets.mtlx import write_mtlx

MATRIX = np.array([[30.0, 12.0], [-16.0, 40.0]])
RECORDED = json.loads(Path(__file__).with_name("materialx_lobes.json").read_text())
OPACITY = {"opacity": Value("float", 0.5)}

PIXELS: dict[str, np.ndarray] = {}
"""What textures hold, by the names of their files."""

MATH = {
    "multiply": np.multiply, "add": np.add, "subtract": np.subtract, "max": np.maximum,
    "power": np.power, "dotproduct": np.dot, "divide": np.divide,
    "combine2": lambda a, b: np.array((a, b)),
}  # fmt: skip
PLAIN = {
    "sin": np.sin, "cos": np.cos, "sign": np.sign, "absval": np.abs, "sqrt": np.sqrt, "exp": np.exp,
}  # fmt: skip


@pytest.mark.parametrize("row", RECORDED["rows"], ids=lambda row: row["preset"])
def test_materialx_renders_the_mixture(row):
    wi, wo = np.array(RECORDED["wi"]), np.array(RECORDED["wo"])
    got = np.array(row["values"])
    assert evaluate(from_dict(row["mixture"]), wi, wo) == pytest.approx(got, rel=1e-3, abs=1e-6)


def value_of(graph, source, eye, light):
    """What an unrolled network gives on a plane whose tangents are x and y."""
    if isinstance(source, Value):
        return np.asarray(source.value)
    assert isinstance(source, Link)
    node = graph.node(source.node)
    if node.category == "image":
        return PIXELS[node.inputs["file"].path.stem]
    given = {k: value_of(graph, s, eye, light) for k, s in node.inputs.items() if k != "space"}
    if node.kind == "BSDF":
        return closure(node, given, eye, light)
    if node.category in MATH:
        return MATH[node.category](given["in1"], given["in2"])
    if node.category in PLAIN:
        return PLAIN[node.category](given["in"])
    if node.category == "combine3":
        return np.array([given[f"in{k}"] for k in (1, 2, 3)])
    if node.category == "extract":
        return given["in"][int(given["index"])]
    if node.category == "mix":
        return given["bg"] + given["mix"] * (given["fg"] - given["bg"])
    if node.category == "clamp":
        return np.clip(given["in"], given["low"], given["high"])
    if node.category == "normalize":
        return given["in"] / np.linalg.norm(given["in"])
    if node.category == "ifgreater":
        return given["in1"] if given["value1"] > given["value2"] else given["in2"]
    return {
        "viewdirection": -eye, "normal": np.array([0.0, 0, 1]), "tangent": np.array([1.0, 0, 0]),
        "bitangent": np.array([0.0, 1, 0]),
    }[node.category]  # fmt: skip


def closure(node, given, eye, light):
    if node.category == "add":
        return given["in1"] + given["in2"]
    n = given["normal"]
    if node.category == "oren_nayar_diffuse_bsdf":
        return given["color"] * max(n @ light, 0.0) / np.pi
    if node.category == "sheen_bsdf":
        local = (w[None] * np.array([1.0, 1.0, n[2]]) for w in (light, eye))
        return given["color"] * sheen_value(float(given["roughness"]), *local)
    if n @ eye <= 0.0:
        return np.zeros(3)
    t = given["tangent"]
    local = (np.array([[w @ t, w @ np.cross(n, t), w @ n]]) for w in (light, eye))
    along_x = replace(LEVEL, along=0)
    one = reflected(MATERIALX, along_x, 0.0, tuple(given["roughness"]), *local)
    face_on, grazing = given["color0"], given["color90"]
    half = (light + eye) / np.linalg.norm(light + eye)
    f = face_on + (grazing - face_on) * (1.0 - half @ eye) ** given["exponent"]
    return one.value[0] * f * (1.0 + f * one.spared[0])


def shown(graph, wi, wo):
    end = graph.node(graph.terminal).inputs["bsdf"]
    return np.array([value_of(graph, end, o, i) for i, o in zip(wi, wo, strict=True)])


def turned(w):
    u = MATRIX[0] / np.linalg.norm(MATRIX[0])
    return w @ np.array([[u[0], u[1], 0.0], [-u[1], u[0], 0.0], [0.0, 0.0, 1.0]])


def test_the_unrolled_network_computes_the_mixture():
    wi, wo = directions(60)
    graph = unrolled(lobes(OPACITY, False, mixture(MATERIALX), MATRIX))
    assert shown(graph, turned(wi), turned(wo)) == pytest.approx(
        evaluate(mixture(MATERIALX), wi, wo), rel=1e-6, abs=1e-9
    )


def test_the_back_of_a_sheet_looks_like_its_front():
    wi, wo = directions(20)
    below = np.array([1.0, 1.0, -1.0])
    graph = unrolled(lobes(OPACITY, False, mixture(MATERIALX), MATRIX))
    front = shown(graph, turned(wi), turned(wo))
    assert shown(graph, turned(wi) * below, turned(wo) * below) == pytest.approx(front)


def test_usd_gets_standard_nodes_alone():
    graph = lobes(OPACITY, False, mixture(MATERIALX), MATRIX)
    assert any(node.identifier == LOBE.identifier for node in graph.nodes)
    flat = unrolled(graph)
    assert not any("fabricusd" in node.identifier for node in flat.nodes)
    names = [node.name for node in flat.nodes]
    assert len(set(names)) == len(names)
    links = [s for node in flat.nodes for s in node.inputs.values() if isinstance(s, Link)]
    assert {one.node for one in links} <= set(names)


def test_a_graph_without_definitions_is_not_changed_by_unrolling():
    constants = {
        "base_color": Value("color3", (0.5,) * 3), "roughness_along": Value("float", 0.5),
        "roughness_across": Value("float", 0.5), "opacity": Value("float", 1.0),
        "normal": Value("vector3", (0.5, 0.5, 1.0)), "tangent": Value("vector3", (1.0, 0.0, 0.0)),
    }  # fmt: skip
    graph = GRAPHS["openpbr"](constants, True)
    assert unrolled(graph) == graph


def document_of(folder, graph):
    mx = pytest.importorskip("MaterialX")
    write_mtlx(folder / "a.mtlx", [("a", graph, {})])
    library, search = mx.createDocument(), mx.getDefaultDataSearchPath()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), search, library)
    document = mx.createDocument()
    mx.readFromXmlFile(document, str(folder / "a.mtlx"))
    document.importLibrary(library)
    return document, search


@pytest.mark.parametrize("rolled", [True, False])
def test_materialx_validates_and_generates_every_language(tmp_path, rolled):
    graph = lobes(OPACITY, False, mixture(MATERIALX), MATRIX)
    document, search = document_of(tmp_path, graph if rolled else unrolled(graph))
    valid, message = document.validate()
    assert valid, message
    from MaterialX import PyMaterialXGenGlsl, PyMaterialXGenMdl, PyMaterialXGenOsl
    from MaterialX import PyMaterialXGenShader as shaders

    for generator in (
        PyMaterialXGenGlsl.GlslShaderGenerator, PyMaterialXGenOsl.OslShaderGenerator,
        PyMaterialXGenMdl.MdlShaderGenerator,
    ):  # fmt: skip
        made = generator.create()
        context = shaders.GenContext(made)
        context.registerSourceCodeSearchPath(search)
        shader = made.generate("a", document.getNode("a_surface"), context)
        assert len(shader.getSourceCode(shaders.PIXEL_STAGE)) > 1000


def test_a_document_defines_the_lobe_once(tmp_path):
    graph = lobes(OPACITY, False, mixture(MATERIALX), MATRIX)
    write_mtlx(tmp_path / "a.mtlx", [("a", graph, {}), ("b", graph, {})])
    root = ElementTree.parse(tmp_path / "a.mtlx").getroot()
    assert len(root.findall("nodedef")) == 1
    assert len(root.findall(f"nodegraph/{LOBE.category}")) == 2 * mixture(MATERIALX).count


def test_a_weight_above_one_is_not_clamped():
    wi, wo = directions(40)
    strong = replace(mixture(MATERIALX).lobes[0], color=(3.0, 2.0, 5.0), crossing=-2.0)
    one = mixture(MATERIALX, strong)
    graph = unrolled(lobes(OPACITY, False, one, MATRIX))
    assert shown(graph, turned(wi), turned(wo)) == pytest.approx(evaluate(one, wi, wo), rel=1e-6)
