"""Cloth that the path tracer photographed comes back; real photographs where there are some."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fabricusd.appearance.conserving.multiple import conserving_tables
from fabricusd.appearance.surface import evaluate
from fabricusd.errors import FabricError
from fabricusd.fabric import FACETS, Fabric, TangentCurve, Thread, ThreadSet
from fabricusd.measure.flat import law
from fabricusd.measure.flat.compare import as_bright, compare
from fabricusd.measure.flat.fit import fit_flat
from fabricusd.measure.flat.page import page_text
from fabricusd.measure.flat.photograph import Photograph, read_photograph
from fabricusd.measure.flat.scene import photograph_of, scene_of
from fabricusd.measure.flat.setup import Setup
from fabricusd.measure.flat.tones import light_of, through_color
from fabricusd.weaves import parse_weave

SETUP = Setup(light=(0.0, 1.0, 1.0), back_light=(0.0, 0.0, -1.125), view_angle=53.0)
PITCH = (7.3, 8.1)
COLORS = ((0.1, 0.15, 0.5), (0.7, 0.7, 0.65))
REAL = os.environ.get("FABRICUSD_FLAT_PHOTOGRAPHS", "")


def cloth(name="twill 2/1 S"):
    weave = parse_weave(name).weave
    curve = TangentCurve(angles=(-0.35, 0.35))
    threads = {
        which: Thread(albedo=color, ior=1.5, isotropic=0.4, gamma_surface=0.25, gamma_volume=0.5,
                      curve=curve)
        for which, color in zip(law.NAMES, COLORS, strict=True)
    }  # fmt: skip
    share = weave.warp_share
    return Fabric(
        threads=threads, weave=weave, model="conserving", surface_law=FACETS,
        warp=ThreadSet(sequence=(0,), coverage=0.96 * share),
        weft=ThreadSet(sequence=(1,), coverage=0.96 * (1 - share)),
    )  # fmt: skip


def pairs():
    wi, wo, _ = SETUP.pairs(SETUP.places((96, 96), 16))
    behind, _, _ = SETUP.pairs(SETUP.places((96, 96), 16), behind=True)
    return (wi, wo), (behind, wo)


@pytest.mark.slow
def test_columns_add_up_to_the_law_on_both_sides():
    fabric = cloth()
    known = law.balance(fabric)
    assert known.tables.sides.shape == conserving_tables(fabric).sides.shape
    for wi, wo in pairs():
        found = law.radiance(
            law.columns(fabric, known, (wi, wo)), np.array(COLORS), law.shades(fabric, known.escape)
        )
        assert found == pytest.approx(evaluate(fabric, wi, wo), rel=1e-6)


@pytest.mark.slow
def test_the_mean_of_a_patch_is_level_far():
    fabric = cloth("plain")
    known, shade = law.balance(fabric), law.shades(fabric, law.balance(fabric).escape)
    pair = np.array([0.0, 0.3, 0.954]), np.array([0.0, 0.0, 1.0])
    pair = tuple(w / np.linalg.norm(w) for w in pair)
    part = law.patch(fabric, known, pair, np.diag([1 / 6, 1 / 6]))
    mean = law.patch_radiance(part, np.array(COLORS), shade).mean(axis=(0, 1))
    whole = law.radiance(
        law.columns(fabric, known, tuple(w[None] for w in pair)), np.array(COLORS), shade
    )[0]
    assert mean == pytest.approx(whole, rel=0.02)


@pytest.fixture(scope="module")
def fitted():
    shape = (160, 160)
    picture = photograph_of(
        scene_of(cloth(), SETUP, shape, pitch=PITCH, turn=0.0, gain=6.0), shape, spp=16
    )
    front = Photograph(name="front.png", linear=np.clip(picture, 0.0, 1.0))
    return fit_flat(front, None, SETUP)


@pytest.mark.exhaustive
def test_a_known_cloth_comes_back_from_its_render(fitted):
    assert fitted.lattice.weave.name == "twill 2/1 S"
    assert fitted.lattice.pitch == pytest.approx(PITCH, rel=0.01)
    # Without a card, only the product of the lamp and the colours is held.
    found = np.array([t.albedo for t in fitted.fabric.thread_list]) * fitted.gain / 6.0
    assert found[0, 2] > 2.5 * found[0, 0]
    # The sets' colours come out nearer to one another than they are: docs, What falls short.
    assert found[1, 0] > 3 * found[0, 0]
    assert found == pytest.approx(np.array(COLORS), abs=0.17)
    figures = compare(fitted, spp=8).figures
    assert figures["render"] < 0.45 * figures["constant colour"]
    assert figures["render"] < 0.7 * figures["its own tile, relit"]


@pytest.mark.exhaustive
def test_every_number_has_an_interval_that_holds_it_and_a_source(fitted):
    assert len({v.label for v in fitted.values}) == len(fitted.values)
    for v in fitted.values:
        assert v.low <= v.value <= v.high, v
        assert v.source in {"fitted", "spectrum", "assumed", "autocorrelation", "specks"}, v
    text = page_text(fitted, compare(fitted, spp=1))
    assert text.count("<img") == 6
    assert all(v.label in text for v in fitted.values)


def test_two_photographs_of_two_sizes_are_refused():
    one, two = (Photograph(name=f"{n}.png", linear=np.full((n, n, 3), 0.3)) for n in (128, 130))
    with pytest.raises(FabricError, match=r"130\.png.*130 x 130 pixels; it must be 128 x 128"):
        fit_flat(one, two, SETUP, weave="plain")


def test_a_second_photograph_needs_its_lamp():
    one = Photograph(name="a.png", linear=np.full((128, 128, 3), 0.3))
    with pytest.raises(FabricError, match=r"--back-light is missing"):
        fit_flat(one, one, replace(SETUP, back_light=None), weave="plain")


def test_a_photograph_that_is_saturated_nearly_everywhere_is_refused():
    linear = np.full((240, 240, 3), 0.3)
    linear[::4, ::4] = 1.0
    with pytest.raises(FabricError, match=r"0 of 576 squares without saturated pixels"):
        light_of(Photograph(name="hot.png", linear=linear), SETUP, 0.0)


def test_the_colour_that_comes_through_leaves_out_clipped_channels():
    linear = np.full((240, 240, 3), 0.3) * [1.0, 0.5, 0.0]
    light = light_of(Photograph(name="red.png", linear=linear), SETUP, 0.0, behind=True)
    red, green, blue = through_color(light)
    assert red == pytest.approx(np.log(2.0))
    assert green == pytest.approx(0.0)
    assert np.isnan(blue)


def test_red_cloth_lit_from_behind_is_made_as_bright_though_two_channels_are_black():
    photograph = np.tile([0.301, 0.001, 0.001], (8, 8, 1))
    photograph[0, 0] = 1.0
    picture = np.tile([0.52, 0.02, 0.02], (8, 8, 1))
    assert as_bright(picture, photograph).mean(axis=2) == pytest.approx(0.101)


def test_pitches_belong_to_a_weave():
    one = Photograph(name="a.png", linear=np.full((128, 128, 3), 0.3))
    with pytest.raises(FabricError, match=r"--weave is missing"):
        fit_flat(one, None, SETUP, pitch=(7.0, 7.0))


@pytest.mark.exhaustive
@pytest.mark.skipif(not REAL, reason="FABRICUSD_FLAT_PHOTOGRAPHS names no folder of photographs")
@pytest.mark.parametrize(
    ("name", "weave"), [("twill5", "twill 2/1"), ("satin1", "satin 5"), ("twill1", "twill 3/1")]
)
def test_real_cloth_is_nearer_than_a_constant_and_than_its_own_tile(name, weave):
    front, behind = (read_photograph(Path(REAL) / f"{name}_{side}.png") for side in "RT")
    figures = compare(fit_flat(front, behind, SETUP, weave=weave), spp=16).figures
    assert figures["render"] < figures["constant colour"]
    assert figures["render"] < figures["its own tile, relit"]
