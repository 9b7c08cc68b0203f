"""Shading networks: the same in USD and in MaterialX, and right in each model's own terms."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdShade

from fabricusd.materials.bake_folder import BakedLay
from fabricusd.materials.lobes.known import mixture_of
from fabricusd.materials.lobes.mixture import MATERIALX
from fabricusd.materials.lobes.network import lobes
from fabricusd.materials.networks.graph import Parameter, Texture, Value, unrolled
from fabricusd.materials.networks.hair import absorption, hair
from fabricusd.materials.networks.look import Look
from fabricusd.materials.networks.surfaces import (
    GRAPHS,
    LIT_THROUGH,
    MAPS,
    parameter_values,
    preview,
)
from fabricusd.materials.targets.mtlx import write_mtlx
from fabricusd.materials.targets.write_usd import write_material
from fabricusd.schema import load
from tests.materials.graphs import alphas, value_of

LOOK = Look(
    smooth_scale=0.8, rough_scale=0.9, base_color_scale=(1.5, 1.0, 0.5), fuzz_weight=0.25,
    specular_tint=(0.8, 0.6, 0.4), transmission_scale=(0.5, 0.5, 1.0),
)  # fmt: skip
CONSTANTS = {
    "base_color": Value("color3", (0.5, 0.4, 0.3)),
    "roughness_along": Value("float", 0.4),
    "roughness_across": Value("float", 0.9),
    "opacity": Value("float", 0.7),
    "normal": Value("vector3", (0.5, 0.5, 1.0)),
    "tangent": Value("vector3", (0.6, 0.8, 0.0)),
    "specular_tint": Value("color3", (0.5, 1.0, 1.0)),
    "transmission_color": Value("color3", (0.2, 0.4, 0.15)),
}
ALPHA_SMOOTH, ALPHA_ROUGH = (0.4 * 0.8) ** 2, (0.9 * 0.9) ** 2


def surface_inputs(kind):
    graph = GRAPHS[kind](CONSTANTS, False)
    world = {
        "tangent": np.array([1.0, 0, 0]), "bitangent": np.array([0, 1.0, 0]),
        "normal": np.array([0, 0, 1.0]),
    }  # fmt: skip
    found = graph.node(graph.terminal).inputs
    return {name: value_of(graph, source, world, LOOK) for name, source in found.items()}


@pytest.mark.parametrize("kind", GRAPHS)
def test_every_model_gets_the_alphas_that_were_baked(kind):
    assert alphas(kind, surface_inputs(kind)) == pytest.approx((ALPHA_ROUGH, ALPHA_SMOOTH))


@pytest.mark.parametrize("kind", GRAPHS)
def test_the_tangent_is_the_rougher_axis_and_the_colour_is_scaled(kind):
    given = surface_inputs(kind)
    tangent = given.get("geometry_tangent", given.get("tangent"))
    assert np.allclose(tangent, (-0.8, 0.6, 0.0))
    weight = given.get("subsurface_weight", given.get("subsurface", 0.0))
    assert np.allclose((1.0 - weight) * given["base_color"], (0.75, 0.4, 0.15))
    assert np.allclose(given["specular_color"], (0.4, 0.6, 0.4))


@pytest.mark.parametrize("kind", LIT_THROUGH)
def test_a_thin_sheet_transmits_the_map_times_its_scale(kind):
    given = surface_inputs(kind)
    weight = given.get("subsurface_weight", given.get("subsurface"))
    assert np.allclose(weight * given["subsurface_color"], (0.1, 0.2, 0.15))
    # MaterialX up to 1.39.5 squares the colour, which leaves a channel of 1 alone.
    assert np.max(given["subsurface_color"]) == pytest.approx(1.0)


@pytest.mark.parametrize("kind", GRAPHS)
def test_a_surface_without_transmission_has_no_thin_sheet(kind):
    plain = {name: value for name, value in CONSTANTS.items() if name != "transmission_color"}
    graph = GRAPHS[kind](plain, False)
    assert not {"subsurface", "subsurface_weight"} & set(graph.node(graph.terminal).inputs)


@pytest.mark.parametrize("kind", GRAPHS)
def test_without_a_map_of_it_the_tint_is_the_parameter(kind):
    plain = {name: value for name, value in CONSTANTS.items() if name != "specular_tint"}
    graph = GRAPHS[kind](plain, False)
    assert graph.node(graph.terminal).inputs["specular_color"] == Parameter("specular_tint")


def networks():
    textures = {
        name: Texture((_here() / f"{name}.exr"), kind == "color3") for name, kind in MAPS.items()
    }
    for kind, make in GRAPHS.items():
        yield f"{kind}_textures", make(textures, False)
        yield f"{kind}_constants", make(CONSTANTS, True)
    lay = BakedLay(
        name="silk_shot", fabric=load("silk_shot"), matrix=np.array([[30.0, 10.0], [-10.0, 30.0]]),
        offset=np.zeros(2),
    )  # fmt: skip
    yield "hair", hair(textures, False, lay)
    worn = mixture_of(load("silk_shot"), 4, MATERIALX)
    yield "lobes", unrolled(lobes(textures, False, worn, lay.matrix))


def _here():
    from pathlib import Path

    return Path("maps").absolute()


def test_usd_and_materialx_hold_the_same_nodes_and_connections(tmp_path):
    found = list(networks())
    write_mtlx(
        tmp_path / "a.mtlx", [(name, graph, parameter_values(LOOK)) for name, graph in found]
    )
    root = ElementTree.parse(tmp_path / "a.mtlx").getroot()
    stage = Usd.Stage.CreateInMemory()
    for name, graph in found:
        write_material(stage, Sdf.Path(f"/{name}"), [("", graph)], parameter_values(LOOK), tmp_path)
        inside = next(g for g in root.findall("nodegraph") if g.get("name") == f"{name}_maps")
        document = {n.get("name"): n for n in inside if n.tag not in ("input", "output")}
        prims = {
            p.GetName(): UsdShade.Shader(p)
            for p in stage.GetPrimAtPath(f"/{name}").GetChildren()
            if p.GetName() != "surface"
        }
        assert prims.keys() == document.keys()
        for key, shader in prims.items():
            written = {i.get("name"): i for i in document[key].findall("input")}
            assert {i.GetBaseName() for i in shader.GetInputs()} == written.keys()
            for given in shader.GetInputs():
                source = given.GetConnectedSources()[0]
                if source and source[0].source.GetPath().name != name:
                    assert (
                        written[given.GetBaseName()].get("nodename")
                        == source[0].source.GetPath().name
                    )


def test_materialx_validates_and_generates_every_language(tmp_path):
    mx = pytest.importorskip("MaterialX")
    from MaterialX import PyMaterialXGenGlsl, PyMaterialXGenMdl, PyMaterialXGenOsl
    from MaterialX import PyMaterialXGenShader as shaders

    found = list(networks())
    path = tmp_path / "a.mtlx"
    write_mtlx(path, [(name, graph, parameter_values(LOOK)) for name, graph in found])
    library, search = mx.createDocument(), mx.getDefaultDataSearchPath()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), search, library)
    document = mx.createDocument()
    mx.readFromXmlFile(document, str(path))
    document.importLibrary(library)
    valid, message = document.validate()
    assert valid, message
    generators = (
        PyMaterialXGenGlsl.GlslShaderGenerator,
        PyMaterialXGenOsl.OslShaderGenerator,
        PyMaterialXGenMdl.MdlShaderGenerator,
    )
    for kind in generators:
        generator = kind.create()
        context = shaders.GenContext(generator)
        context.registerSourceCodeSearchPath(search)
        for material in document.getMaterialNodes():
            surface = mx.getShaderNodes(material)[0]
            made = generator.generate(material.getName(), surface, context)
            assert len(made.getSourceCode("pixel")) > 1000


def test_hair_runs_along_its_threads_with_their_widths():
    graph = dict(networks())["hair"]
    weft, warp = graph.node("weft"), graph.node("warp")
    green, red = load("silk_shot").thread_list
    assert weft.inputs["roughness_R"].value[0] == pytest.approx((2 * green.gamma_surface) ** 2)
    assert warp.inputs["ior"].value == pytest.approx(red.ior)
    # Threads = matrix @ uv: the weft runs where the second coordinate stands still.
    axis = [graph.node(f"weft_{k}").inputs["in2"].value for k in "uv"]
    assert np.array([-10.0, 30.0]) @ axis == pytest.approx(0.0)
    assert graph.node("threads").inputs["mix"].value == pytest.approx(0.14)
    assert np.all(np.diff(absorption((0.9, 0.5, 0.1))) > 0)


def test_the_preview_surface_takes_the_look_into_its_readers():
    textures = {name: Texture(_here() / f"{name}.exr") for name in MAPS}
    graph = preview(textures, LOOK, True)
    assert graph.node("Preview_base_color").inputs["scale"] == Value("float4", (1.5, 1.0, 0.5, 1.0))
    normal = graph.node("Preview_normal").inputs
    assert normal["scale"].value == (2.0, 2.0, 2.0, 1.0)
    assert normal["bias"].value == (-1.0, -1.0, -1.0, 0.0)
    assert "opacity" not in graph.node("Preview").inputs
    assert "opacity" in preview(textures, LOOK, False).node("Preview").inputs
