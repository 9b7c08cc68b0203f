"""Uneven threads keep what even ones show, on average, and are as uneven as they are said to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance import surface
from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.appearance.weave.yarn.compiled import CUT, compile_yarn
from fabricusd.appearance.weave.yarn.lay import edges, laid
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, Thread, even
from fabricusd.schema import load, published_names
from tests.appearance.presets import often

SPUN = {
    "unevenness_cv": 0.2,
    "unevenness_length": 5e-3,
    "unevenness_count": 0.1,
    "unevenness_shade": 0.15,
}
SLUBS = {"slub_amount": 1.0, "slub_length": 15e-3, "slub_spacing": 50e-3}
PLIED = {"plies": 2, "twist": 450.0}
CLOTHS = ("linen_plain", "polyester_satin_charmeuse", "silk_crepe_de_chine", "rayon_shantung")


def woven(name: str, **yarn: float) -> Fabric:
    """A preset whose threads are all uneven in the same way."""
    fabric = even(load(name))
    return replace(fabric, threads={k: replace(t, **yarn) for k, t in fabric.threads.items()})


def places(count: int, window: float = 64.0, corner: float = 1000.0, seed: int = 0):
    """(count^2, 2) jittered places of a window of threads."""
    rng = np.random.default_rng(seed)
    line = np.arange(count)
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    return corner + (grid + rng.random(grid.shape)) * window / count


@pytest.mark.parametrize("yarn", [SPUN, {**SPUN, **SLUBS}], ids=["spun", "slubs"])
@pytest.mark.parametrize("name", often(CLOTHS))
def test_a_window_of_64_threads_shows_what_the_even_cloth_shows(name, yarn):
    """The window's own sampling moves its means by less than a tenth of the bound."""
    cloth = woven(name, **yarn)
    uv = places(1024)
    hit, true = lookup(cloth, uv), lookup(even(cloth), uv)
    for which in (WEFT, WARP):
        assert (hit.set == which).mean() == pytest.approx((true.set == which).mean(), abs=0.01)
        mine, of_even = hit.set == which, true.set == which
        for power in (1, 2):
            assert (hit.angle[mine] ** power).mean() == pytest.approx(
                (true.angle[of_even] ** power).mean(), abs=0.01
            )
            assert (hit.across[mine] ** power).mean() == pytest.approx(
                (true.across[of_even] ** power).mean(), abs=0.01
            )
    assert hit.shade[hit.set <= WARP].mean() == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("name", ["linen_plain", "rayon_shantung", "polyester_satin_charmeuse"])
def test_many_windows_together_are_the_even_cloth(name):
    """Nothing is biased: over 100 windows the shares agree within a thousandth of the cloth."""
    cloth = woven(name, **SPUN, **SLUBS)
    share = coverage(cloth)
    rng = np.random.default_rng(3)
    uv = rng.random((2_000_000, 2)) * 640 - 10_000
    hit = lookup(cloth, uv)
    for which in (WEFT, WARP):
        assert (hit.set == which).mean() == pytest.approx(share.area[which], abs=1.5e-3)


@pytest.mark.parametrize("name", often(CLOTHS))
def test_the_mean_over_a_window_is_the_radiance_of_the_even_cloth(name):
    cloth = woven(name, **SPUN)
    uv = places(512)
    wi, wo = (0.48, 0.36, 0.8), (-0.1, -0.28, 0.955)
    for level in ("weave", "thread"):
        found = surface.evaluate(cloth, wi, wo, uv, level).mean(axis=0)
        true = surface.evaluate(even(cloth), wi, wo, uv, level).mean(axis=0)
        assert found == pytest.approx(true, rel=0.01), level


@pytest.mark.parametrize("name", often(n for n in published_names() if not n.startswith("thread_")))
def test_the_mean_of_a_preset_under_a_shadow_is_that_of_the_even_cloth(name):
    """Law and shadow look at one place of the even cloth, so what they have in common is kept."""
    cloth = load(name)
    assert cloth.is_uneven
    # Highlights are narrow: with a quarter as many places, their mean is off by up to a hundredth.
    uv = places(1024)
    wo = (0.0, 0.0, 1.0)
    for wi, level in (((-0.7, 0.5, 0.51), "weave"), ((0.48, 0.36, 0.8), "thread")):
        found, true = (
            surface.evaluate(f, wi, wo, uv, level, "horizon").mean(axis=0)
            for f in (cloth, even(cloth))
        )
        assert found == pytest.approx(true, rel=0.01), level


@pytest.mark.parametrize("name", often(CLOTHS))
def test_plies_keep_the_mean_across_and_along_a_thread(name):
    cloth = woven(name, **PLIED)
    uv = places(512)
    wi, wo = (0.48, 0.36, 0.8), (-0.1, -0.28, 0.955)
    found = surface.evaluate(cloth, wi, wo, uv, "thread").mean(axis=0)
    true = surface.evaluate(even(cloth), wi, wo, uv, "thread").mean(axis=0)
    assert found == pytest.approx(true, rel=0.01)


@pytest.mark.exhaustive
def test_level_far_has_the_same_bits():
    wi, wo = np.random.default_rng(2).normal(size=(2, 200, 3))
    wi[:, 2], wo[:, 2] = abs(wi[:, 2]), abs(wo[:, 2])
    wi, wo = (w / np.linalg.norm(w, axis=1)[:, None] for w in (wi, wo))
    for name in CLOTHS:
        cloth = woven(name, **SPUN, **SLUBS, **PLIED)
        for fabric in (cloth, replace(cloth, model="conserving")):
            assert np.array_equal(
                surface.evaluate(fabric, wi, wo), surface.evaluate(even(fabric), wi, wo)
            )


@pytest.mark.parametrize("name", published_names())
def test_an_even_cloth_is_looked_up_as_if_yarn_were_unknown(name):
    """The map of a yarn that varies by nothing is the identity."""
    fabric = even(load(name))
    assert not fabric.is_uneven
    uv = places(64, corner=-1000.0)
    assert np.allclose(laid(compile_yarn(fabric, precision=np.float64), uv).uv, uv, atol=2e-7)


@pytest.mark.parametrize("name", ["linen_plain", "rayon_shantung", "polyester_satin_charmeuse"])
def test_the_width_of_pieces_of_8_mm_varies_by_half_of_cvm(name):
    """Of a thread with room, and of threads that touch."""
    cloth = woven(name, unevenness_cv=0.12, unevenness_length=5e-3)
    yarn = compile_yarn(cloth, precision=np.float64)
    numbers, pieces, inside = np.arange(200), 50, 32
    metres = (np.arange(pieces * inside) + 0.5) * CUT / inside
    for which in (WEFT, WARP):
        k, s = (x.ravel() for x in np.meshgrid(numbers, metres, indexing="ij"))
        found = edges(yarn, which, k, s)
        width = (found[:, 1] - found[:, 0]).reshape(len(numbers), pieces, inside).mean(axis=2)
        # Borders give way less and less, so threads that touch vary a little less than is asked.
        assert width.std() / width.mean() == pytest.approx(0.06, rel=0.1)
        assert width.mean() == pytest.approx(coverage(cloth).width[which], rel=0.003)


@pytest.mark.parametrize("name", CLOTHS)
def test_threads_never_overlap_nor_vanish(name):
    cloth = woven(name, unevenness_cv=0.5, unevenness_length=4e-3, unevenness_count=0.3, **SLUBS)
    yarn = compile_yarn(cloth, precision=np.float64)
    numbers = np.arange(-100, 100)
    for which in (WEFT, WARP):
        full = coverage(cloth).width[which]
        for metres in np.linspace(0, 0.3, 40):
            found = edges(yarn, which, numbers, np.full(200, metres))
            left, right = found[:, 0] + numbers, found[:, 1] + numbers
            assert (right - left > 0.14 * full).all()
            assert (left[1:] - right[:-1] > -1e-9).all()


def test_edges_are_where_the_lookup_finds_them():
    """Seen from far enough above that nothing crosses: a set that is always on top."""
    cloth = woven("polyester_satin_charmeuse", **SPUN)
    yarn = compile_yarn(cloth, precision=np.float64)
    rng = np.random.default_rng(5)
    uv = rng.random((20000, 2)) * 40
    found = laid(yarn, uv)
    k = found.numbers[:, WARP]
    end = edges(yarn, WARP, k, uv[:, 1] * yarn.cell[WARP])
    assert (uv[:, 0] >= k + end[:, 0] - 1e-6).all()
    assert (uv[:, 0] <= k + end[:, 1] + 1e-6).all()


def test_the_same_thread_is_as_thick_in_every_repeat_only_by_chance():
    cloth = woven("linen_plain", **SPUN)
    here, there = (lookup(cloth, places(128, 8.0, corner)) for corner in (0.0, 64.0))
    assert (here.set != there.set).mean() > 0.02
    other = lookup(replace(cloth, unevenness_seed=1), places(128, 8.0, 0.0))
    assert (here.set != other.set).mean() > 0.02
    again = lookup(replace(cloth), places(128, 8.0, 0.0))
    assert np.array_equal(here.set, again.set)


def test_shades_keep_the_albedo_of_conserving_threads_from_0_to_1():
    for albedo in (0.05, 0.5, 0.97, 1.0):
        cloth = woven("linen_plain", unevenness_shade=0.5, unevenness_length=5e-3)
        threads = {k: replace(t, albedo=(albedo,) * 3) for k, t in cloth.threads.items()}
        cloth = replace(cloth, threads=threads, model="conserving")
        shade = lookup(cloth, places(256)).shade
        assert (albedo * shade >= 0).all()
        assert (albedo * shade <= 1 + 1e-12).all()
        assert (shade.std() > 1e-3) == (albedo < 1.0)


@pytest.mark.parametrize("turns", [pytest.param(400.0, marks=pytest.mark.exhaustive), -400.0])
def test_z_twist_runs_like_the_middle_of_a_z(turns):
    """Along a warp thread seen from its front, the border of two plies moves to the right."""
    cloth = woven("linen_plain", plies=2, twist=turns)
    line, steps = np.linspace(0.35, 0.65, 301), []
    for cell in range(12):  # the warp is on top where both numbers are equal
        border = []
        for v in cell + np.linspace(0.1, 0.9, 33):
            hit = lookup(cloth, np.stack((cell + line, np.full_like(line, v)), axis=1))
            jump = np.abs(np.diff(hit.strand)) > 1.0
            border.append(line[:-1][jump][0] if jump.any() else np.nan)
        steps += list(np.diff(border))
    moved = np.array([x for x in steps if abs(x) < 0.05])
    assert len(moved) > 50
    assert (np.sign(moved) == np.sign(turns)).mean() > 0.95


def test_places_that_cannot_be_counted_are_even_and_nan_stays_nan():
    cloth = woven("linen_plain", **SPUN)
    yarn = compile_yarn(cloth, precision=np.float64)
    odd = np.array([[np.nan, 0.5], [0.5, np.inf], [2.0**40 + 0.25, 0.5]])
    assert np.array_equal(laid(yarn, odd).uv, odd, equal_nan=True)


@pytest.mark.parametrize(
    ("wrong", "where"),
    [
        ({"unevenness_cv": 0.2}, "unevenness_length"),
        ({"unevenness_shade": 0.2}, "unevenness_length"),
        ({"slub_amount": 1.0}, "slub_length"),
        ({"slub_amount": 1.0, "slub_length": 0.01, "slub_spacing": 0.005}, "slub_spacing"),
        ({"unevenness_cv": -0.1, "unevenness_length": 0.01}, "unevenness_cv"),
        ({"plies": 0}, "plies"),
        ({"plies": 1.5}, "plies"),
        ({"twist": np.nan}, "twist"),
    ],
)
def test_yarn_that_cannot_be_is_refused(wrong, where):
    with pytest.raises(FabricError, match=where):
        Thread(**wrong)
