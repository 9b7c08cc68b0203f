"""A colour asked for is the colour of the cloth, by the law that is rendered and by a bake."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import qmc

from fabricusd.appearance import surface
from fabricusd.appearance.layer import layer_of
from fabricusd.appearance.layer.layer import alone
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.dye import cloth_color, dyed, reached
from fabricusd.dye.difference import difference
from fabricusd.dye.make import made_of_colors, thread_of
from fabricusd.dye.stack import opaque
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.images.files import read_image
from fabricusd.weaves import parse_weave, to_fabric, with_colors
from tests.bake.meshes import write_quad

VIEW = math.radians(8.0)
BLUE = (0.05, 0.2, 0.6)


def cloth(weave: str, *colors: tuple[float, float, float], **told):
    """Cotton of one colour, or of a warp and a weft, dyed; with the notes."""
    draft = with_colors(parse_weave(weave), [colors[0]], [colors[-1]])
    return made_of_colors(to_fabric(draft, thread_of()), palette=colors, **told)


def measured(fabric: Fabric, count: int = 13) -> np.ndarray:
    """(2, 2, 3) R and T at 8 degrees and in diffuse light, by a quadrature of the whole law."""
    u = qmc.Sobol(4, seed=5).random_base2(count)
    phi, psi = 2 * math.pi * u[:, 1], 2 * math.pi * u[:, 3]

    def turned(sine, azimuth, side=1.0):
        up = np.sqrt(1.0 - sine**2)
        return np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), side * up), axis=1)

    found = np.empty((2, 2, 3))
    for row, sine in enumerate((np.full(len(u), math.sin(VIEW)), np.sqrt(u[:, 0]))):
        for side, sign in enumerate((1.0, -1.0)):
            wi = turned(np.sqrt(u[:, 2]), psi, sign)
            value = surface.evaluate(fabric, wi, turned(sine, phi))
            found[row, side] = (value * math.pi / np.abs(wi[:, 2:])).mean(axis=0)
    return found


@pytest.mark.parametrize("weave", ["plain", "satin 8"])
def test_the_law_folded_until_opaque_has_the_colour_asked_for(weave):
    done = cloth(weave, BLUE)
    assert not done.notes
    found = measured(done.fabric)
    albedo = np.array([thread.albedo for thread in done.fabric.thread_list])
    assert found == pytest.approx(layer_of(done.fabric).of(albedo), abs=2e-3)
    assert difference(opaque(found), BLUE) < 0.1


def test_one_layer_over_black_has_the_colour_asked_for():
    dim = (0.05, 0.1, 0.3)
    fabric = cloth("plain", dim, basis="singleLayer").fabric
    assert difference(measured(fabric)[0, 0], dim) < 0.2
    # Folded, that cloth is lighter.
    assert reached(fabric, "Color1", "opaque")[2] > dim[2] + 0.005


def test_cloth_of_two_colours_mixes_them_as_the_law_does():
    fabric = cloth("twill 3/1", BLUE, (0.8, 0.75, 0.7)).fabric
    assert difference(opaque(measured(fabric)), cloth_color(fabric)) < 0.3
    for name, color in zip(fabric.threads, (BLUE, (0.8, 0.75, 0.7)), strict=True):
        assert reached(fabric, name) == pytest.approx(color, abs=1e-6)
        of_it = cloth_color(alone(fabric, fabric.threads[name]))
        assert of_it == pytest.approx(color, abs=1e-6)


def test_a_colour_out_of_reach_becomes_the_nearest_and_says_how_far_it_is():
    done = cloth("plain", (0.01, 0.02, 0.2))
    (note,) = done.notes
    found = reached(done.fabric, "Color1")
    told = float(re.search(r"delta E 2000 ([0-9.]+)", note)[1])
    assert told == pytest.approx(float(difference(found, (0.01, 0.02, 0.2))), rel=0.05)
    assert told > 1
    # No other colour within reach is nearer.
    rng = np.random.default_rng(1)
    black = cloth_color(replace(done.fabric, threads={"A": replace(thread_of(), albedo=(0,) * 3)}))
    others = np.clip(found * np.exp(rng.normal(0, 0.2, (400, 3))), black, 1.0)
    assert float(difference(others, np.array((0.01, 0.02, 0.2))).min()) >= told - 0.05


def test_a_closed_white_furnace_is_white():
    fabric = cloth("plain", (1.0, 1.0, 1.0)).fabric
    assert fabric.threads["Color1"].albedo == (1.0, 1.0, 1.0)
    assert layer_of(fabric).of(np.ones(1)).sum(axis=1) == pytest.approx(1.0, abs=1e-3)


def test_threads_that_differ_only_in_colour_share_a_layer(monkeypatch):
    from fabricusd.dye import solve

    calls = []
    monkeypatch.setattr(solve, "layer_of", lambda fabric: calls.append(1) or layer_of(fabric))
    cloth("plain", BLUE, (0.3, 0.3, 0.1))
    assert len(calls) == 1


def test_a_thread_of_a_published_model_cannot_be_solved_for():
    fabric = cloth("plain", BLUE).fabric
    with pytest.raises(FabricError, match=r"has the model microcylinder, .* must be conserving"):
        dyed(replace(fabric, model="microcylinder"))


@pytest.mark.slow
def test_a_bake_folds_to_the_colour_asked_for(tmp_path):
    fabric = cloth("plain", BLUE).fabric
    settings = Settings(resolution=64, maps=("albedo", "transmission_color"))
    bake(write_quad(tmp_path / "quad.obj"), tmp_path / "out", settings, fabric=fabric)
    r, t = (
        np.asarray(read_image(next((tmp_path / "out").glob(f"*.{name}.exr"))), np.float64)
        .reshape(-1, 3)
        .mean(axis=0)
        for name in ("albedo", "transmission_color")
    )
    albedo = np.array([thread.albedo for thread in fabric.thread_list])
    assert r == pytest.approx(layer_of(fabric).of(albedo)[0, 0], rel=0.01)
    assert difference(opaque(np.array([[r, t], [r, t]])), BLUE) < 2
