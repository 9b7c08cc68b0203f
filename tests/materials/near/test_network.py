"""The nodes of single threads in MaterialX, against `near.mixture`."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from materials.lobes.mixtures import directions
from materials.near.cloths import TEXELS, far_of_two, mixed, near_mixture

from fabricusd.materials.lobes.mixture import of_covered
from fabricusd.materials.lobes.network import lobes
from fabricusd.materials.near.inputs import Laid
from fabricusd.materials.near.maps import TINTS, texel_pixels
from fabricusd.materials.near.mixture import evaluate
from fabricusd.materials.near.network import NearTexel
from fabricusd.materials.networks.graph import Texture, Value, unrolled
from tests.materials.lobes.test_network import MATRIX, OPACITY, document_of, shown, turned

FAR = far_of_two()
RECORDED = json.loads(Path(__file__).with_name("materialx_near.json").read_text())


def laid(texel, *, tints=True, repeat=False):
    """Textures whose names are those of the values that `values_of` gives."""
    names = [name for name in texel_pixels(texel) if tints or name not in TINTS]
    threads = np.array(((3.0, 1.0, 0.5), (-1.0, 2.0, 0.25))) if repeat else None
    textures = {name: Texture(Path(f"/none/{name}.exr")) for name in names}
    return Laid(textures=textures, threads=threads, repeat=(2, 4) if repeat else (1, 1))


def network(near, texel, *, opaque, **more):
    return unrolled(
        lobes(OPACITY, opaque, near.far, MATRIX, lambda b: NearTexel(b, near, laid(texel, **more)))
    )


def rendered(graph, texel, wi, wo, monkeypatch):
    pixels = {name: row[0].astype(float) for name, row in texel_pixels(texel).items()}
    from tests.materials.lobes import test_network

    monkeypatch.setattr(test_network, "PIXELS", pixels)
    return shown(graph, turned(wi), turned(wo))


@pytest.mark.parametrize("name", TEXELS)
def test_the_network_computes_the_lobes_of_the_texel(name, monkeypatch):
    near, texel = near_mixture(FAR), TEXELS[name]
    wi, wo = directions(40)
    found = rendered(network(near, texel, opaque=True), texel, wi, wo, monkeypatch)
    assert found == pytest.approx(evaluate(near, texel, wi, wo), rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("name", TEXELS)
def test_materialx_renders_the_lobes_of_the_texel(name):
    """The values that the GLSL of MaterialX gives, by bench/materials/near_values.py."""
    wi, wo = np.array(RECORDED["wi"]), np.array(RECORDED["wo"])
    got = np.array(RECORDED["values"][name])
    ours = evaluate(near_mixture(FAR), TEXELS[name], wi, wo)
    assert ours == pytest.approx(got, rel=2e-3, abs=1e-6)


def test_no_bound_is_below_the_six_decimals_that_materialx_writes():
    graph = network(near_mixture(FAR), mixed(), opaque=False)
    bounds = [
        given.value
        for node in graph.nodes if node.category == "max"
        for given in node.inputs.values() if isinstance(given, Value)
    ]  # fmt: skip
    assert min(abs(x) for x in bounds if x) >= 1e-6


def test_the_opacity_does_not_dim_the_lobes_twice(monkeypatch):
    near, texel = near_mixture(FAR), mixed()
    wi, wo = directions(20)
    graph = network(near, texel, opaque=False)
    found = rendered(graph, texel, wi, wo, monkeypatch)
    cover = float(texel.sets.sum())
    assert cover == pytest.approx(0.8)
    # What a lobe scatters more than once depends on its reflectance per area of thread.
    covered = replace(near, far=of_covered(near.far, cover))
    assert found == pytest.approx(evaluate(covered, texel, wi, wo), rel=1e-5, abs=1e-7)
    assert graph.node(graph.terminal).inputs["opacity"].node == "threads_cover"


@pytest.mark.parametrize("repeat", [False, True])
def test_materialx_validates_the_network(tmp_path, repeat):
    near = replace(near_mixture(FAR), through=np.full((8, 3), 0.1))
    graph = lobes(
        OPACITY, False, near.far, MATRIX,
        lambda b: NearTexel(b, near, laid(mixed(), repeat=repeat)),
    )  # fmt: skip
    document, search = document_of(tmp_path, graph)
    valid, message = document.validate()
    assert valid, message
    from MaterialX import PyMaterialXGenGlsl
    from MaterialX import PyMaterialXGenShader as shaders

    made = PyMaterialXGenGlsl.GlslShaderGenerator.create()
    context = shaders.GenContext(made)
    context.registerSourceCodeSearchPath(search)
    shader = made.generate("a", document.getNode("a_surface"), context)
    assert "lobes_weft" in shader.getSourceCode(shaders.PIXEL_STAGE)
