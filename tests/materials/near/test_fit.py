"""Fits near by against level `weave`, and textures against both."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.appearance import surface
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.fabric import even
from fabricusd.materials.fit.judge import hemisphere
from fabricusd.materials.lobes import mixture as far
from fabricusd.materials.lobes.known import mixture_of
from fabricusd.materials.near.keep import moved_to, near_of
from fabricusd.materials.near.maps import halved, texels_of
from fabricusd.materials.near.mixture import evaluate
from fabricusd.materials.near.parts import Texels
from fabricusd.materials.near.repeat import repeat_layers
from fabricusd.quality.colors import delta_e_2000
from fabricusd.schema import load

PRESETS = ("linen_plain", "silk_shot")
VIEWS, LIGHTS = hemisphere(5, np.cos(np.radians(75.0))), hemisphere(12)
DRAWN = 160


@pytest.fixture(scope="module", params=PRESETS)
def cloth(request):
    """Fabric, textures of its repeat, and its mixture near by."""
    fabric = even(load(request.param))
    layers, parts = repeat_layers(fabric)
    return fabric, layers, moved_to(near_of(fabric, mixture_of(fabric)), parts)


def chosen(texels, rows):
    return Texels(
        share=texels.share[rows], lean=texels.lean[rows], spread=texels.spread[rows],
        tint=texels.tint[rows],
    )  # fmt: skip


def pairs(count):
    for wo in VIEWS:
        for wi in LIGHTS:
            yield np.tile(wi, (count, 1)), np.tile(wo, (count, 1))


def test_the_coarsest_level_is_the_far_mixture(cloth):
    _, layers, near = cloth
    while len(next(iter(layers.values()))) > 1:
        layers = {name: halved(one) for name, one in layers.items()}
    for wi, wo in pairs(1):
        truth = far.evaluate(near.far, wi, wo)
        # The textures are float32, and an angle is a small difference of them.
        assert evaluate(near, texels_of(layers), wi, wo) == pytest.approx(truth, rel=1e-3)


def test_near_by_single_threads_are_seen(cloth):
    """Of the difference from level `weave`, at most half is left of the far mixture's."""
    fabric, layers, near = cloth
    size = len(layers["lobes_lean"])
    rows = np.random.default_rng(4).choice(size * size, DRAWN, replace=False)
    texels = chosen(texels_of(layers), rows)
    v, u = np.divmod(rows, size)
    ends, picks = true_repeat(fabric)
    uv = np.stack(((u + 0.5) / size * ends, (1.0 - (v + 0.5) / size) * picks), axis=1)
    close, distant = [], []
    for wi, wo in pairs(DRAWN):
        truth = surface.evaluate(fabric, wi, wo, uv, "weave", "horizon")
        close.append(delta_e_2000(np.pi * evaluate(near, texels, wi, wo), np.pi * truth))
        distant.append(delta_e_2000(np.pi * far.evaluate(near.far, wi, wo), np.pi * truth))
    assert np.mean(close) < 0.5 * np.mean(distant)


@pytest.mark.parametrize("level", [0, 2, 4, 6])
def test_the_mean_over_the_texels_of_each_level_is_near_the_far_mixture(cloth, level):
    _, layers, near = cloth
    for _ in range(level):
        layers = {name: halved(one) for name, one in layers.items()}
    texels = texels_of(layers)
    rows = np.arange(len(texels.share))
    if len(rows) > 1024:
        rows = np.random.default_rng(5).choice(rows, 1024, replace=False)
    texels = chosen(texels, rows)
    mine, truth = [], []
    for wi, wo in pairs(len(rows)):
        mine.append(evaluate(near, texels, wi, wo).mean(axis=0))
        truth.append(far.evaluate(near.far, wi[:1], wo[:1])[0])
    assert delta_e_2000(np.pi * np.array(mine), np.pi * np.array(truth)).mean() < 4.0
    assert np.sum(mine) == pytest.approx(np.sum(truth), rel=0.06)


def test_another_share_of_the_parts_keeps_the_means(cloth):
    _, _, near = cloth
    parts = near.parts
    share = parts.share * np.linspace(0.8, 1.2, len(parts.share))
    moved = moved_to(near, type(parts)(share=share, angle=parts.angle, spread=parts.spread))
    assert np.einsum("kbc,b->kc", moved.factors, share) == pytest.approx(1.0)


@pytest.mark.exhaustive
def test_each_set_of_shot_silk_has_its_own_color_near_by():
    """Its weft is green and its warp red."""
    fabric = load("silk_shot")
    near = near_of(fabric, mixture_of(fabric))
    parts = near.parts
    wi, wo = hemisphere(40), np.tile((0.0, 0.0, 1.0), (40, 1))
    found = []
    for which in (0, 1):
        part = 4 * which
        texel = parts.at(np.array((which,)), parts.angle[[part]], np.array((part,)))
        found.append(evaluate(near, texel, wi, wo).mean(axis=0))
    green, red = found
    assert green[1] > 1.5 * green[0]
    assert red[0] > 1.5 * red[1]
