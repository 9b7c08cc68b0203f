"""The published numbers are in the presets, and what is not published says so."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.geometry.conserve import refit, refitted_names
from fabricusd.geometry.nearest import LIKE, law_errors, published, scaled, worn
from fabricusd.schema import load, preset_names, published_names

# [Sadeghi2013] Table II: colour, scale, eta, kd, gs, gv, a, offsets, lengths between them.
PUBLISHED = {
    ("linen_plain", "warp"): (
        (.2, .8, 1), .3, 1.46, .3, 12, 24, .33, (-25, 25), (1,)),
    ("linen_plain", "weft"): (
        (.2, .8, 1), .3, 1.46, .3, 12, 24, .33, (-25, 25), (1,)),
    ("silk_crepe_de_chine", "weft"): (
        (1, .95, .05), .12, 1.345, .2, 5, 10, .75, (-35, -35, 35, 35), (1, 1, 1)),
    ("silk_crepe_de_chine", "warp"): (
        (1, .95, .05), .16, 1.345, .3, 18, 32, .25, (0, 0), (1,)),
    ("polyester_satin_charmeuse", "warp"): (
        (1, .37, .3), .035, 1.539, .1, 2.5, 5, .90,
        (-32, -32, -18, 0, 0, 18, 32, 32), (1.33, .66, 2, 2, 2, .66, 1.33)),
    ("polyester_satin_charmeuse", "weft"): (
        (1, .37, .3), .2, 1.539, .7, 30, 60, .10, (0, 0), (1,)),
    ("polyester_satin_charmeuse_back", "warp"): (
        (1, .37, .3), .035, 1.539, .1, 2.5, 5, .67,
        (-30, -30, 30, 30, -5, -5, 5, 5), (1.33, 1.33, 1.33, 0, .67, .67, .67)),
    ("polyester_satin_charmeuse_back", "weft"): (
        (1, .37, .3), .2, 1.539, .7, 30, 60, .33, (0, 0), (1,)),
    ("silk_shot", "weft"): (
        (.1, 1, .4), .2, 1.345, .1, 4, 8, .86, (-25, -25, 25, 25), (1.33, 2.67, 1.33)),
    ("silk_shot", "warp"): (
        (1, 0, .1), .6, 1.345, .1, 5, 10, .14, (0, 0), (1,)),
    ("velvet", "weft"): (
        (.05, .02, 0), .3, 1.46, .1, 6, 12, .5, (-90, -50), (1,)),
    ("velvet", "warp"): (
        (.05, .02, 0), .3, 1.46, .1, 6, 12, .5, (-90, -55, 55, 90), (.5, 0, .5)),
}  # fmt: skip


@pytest.mark.parametrize(("name", "which"), PUBLISHED)
def test_a_preset_has_the_published_numbers(name, which):
    color, scale, ior, kd, gs, gv, area, offsets, lengths = PUBLISHED[name, which]
    fabric = published(name)
    thread_set = getattr(fabric, which)
    thread = fabric.thread_list[thread_set.sequence[0]]
    assert thread.albedo == pytest.approx([c * scale for c in color], rel=1e-14)
    assert (thread.ior, thread.isotropic) == (ior, kd)
    assert math.degrees(thread.gamma_surface) == pytest.approx(gs, rel=1e-14)
    assert math.degrees(thread.gamma_volume) == pytest.approx(gv, rel=1e-14)
    assert thread_set.coverage == area
    angles = [math.degrees(a) for a in thread.curve.angles]
    assert angles == pytest.approx(list(offsets), rel=1e-14)
    steps = [
        b - a for a, b in zip(thread.curve.positions, thread.curve.positions[1:], strict=False)
    ]
    assert steps == pytest.approx(list(lengths), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", preset_names())
def test_a_preset_says_where_its_numbers_come_from(name):
    fabric = load(name)
    published = {preset for preset, _ in PUBLISHED}
    word = "[Sadeghi2013] Table II" if name in published else "Derived, not published"
    assert word in " ".join(fabric.documentation.split())
    for thread in fabric.thread_list:
        assert (
            "[Sadeghi2013]" in thread.documentation
            or "erived" in thread.documentation
            or ("[Bisker2011]" in thread.documentation)
        )


@pytest.mark.parametrize("name", published_names())
def test_a_preset_is_the_published_one_under_another_law_with_one_factor_on_its_albedos(name):
    fabric, before = load(name), published(name)
    assert before.surface_law == "masked"
    factor = fabric.thread_list[0].albedo[0] / before.thread_list[0].albedo[0]
    expected = replace(scaled(before, factor), surface_law=fabric.surface_law)
    for thread, other in zip(fabric.thread_list, expected.thread_list, strict=True):
        assert thread.albedo == pytest.approx(other.albedo, rel=1e-3)
        assert replace(thread, albedo=other.albedo) == other
    assert replace(fabric, threads=expected.threads, back=None) == replace(expected, back=None)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", published_names())
def test_the_law_is_the_one_nearest_to_the_tubes_and_the_cloth_as_bright_as_published(name):
    law, factor = worn(name, law_errors(LIKE.get(name, name)))
    assert load(name).surface_law == law
    first, before = load(name).thread_list[0], published(name).thread_list[0]
    assert first.albedo[0] == pytest.approx(factor * before.albedo[0], rel=1e-3)


@pytest.mark.parametrize("name", refitted_names())
def test_the_second_opinion_is_the_same_cloth_in_conserving_with_its_hues_kept(name):
    fabric, other = load(name), load(f"{name}{{appearance=conserving}}")
    assert other.model == "conserving"
    assert (other.weave, other.warp, other.weft) == (fabric.weave, fabric.warp, fabric.weft)
    for thread, again in zip(fabric.thread_list, other.thread_list, strict=True):
        assert max(again.albedo) <= 1.0
        hue = np.array(thread.albedo) / max(thread.albedo)
        assert np.array(again.albedo) / max(again.albedo) == pytest.approx(hue, abs=2e-3)
        assert replace(again, albedo=thread.albedo) == thread


@pytest.mark.exhaustive
def test_the_second_opinion_is_found_again():
    name = "wool_flannel"
    found = refit(name).fabric
    stated = load(f"{name}{{appearance=conserving}}")
    assert found.thread_list[0].albedo == pytest.approx(stated.thread_list[0].albedo, rel=5e-3)


def test_the_published_front_has_the_published_back():
    front = published("polyester_satin_charmeuse")
    assert front.back == published("polyester_satin_charmeuse_back")


def test_the_satin_has_a_back_of_its_own():
    assert load("polyester_satin_charmeuse").back == load("polyester_satin_charmeuse_back")


def test_the_seven_threads_of_table_3_2_are_there():
    kinds = ("polyester_filament", "polyester_spun", "silk_filament", "silk_spun",
             "rayon_spun", "wool_spun", "linen_spun")  # fmt: skip
    assert {f"thread_{kind}" for kind in kinds} <= set(preset_names())
