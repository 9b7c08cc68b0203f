"""What the maps hold, at every level."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.shadow.methods import shadowing
from fabricusd.appearance.surface import evaluate, mean_shadow
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.lookup import NO_THREAD, lookup
from fabricusd.bake.error.accuracy import (
    PAIRS,
    display,
    pairs_between,
    swatch_error,
)
from fabricusd.bake.error.relight import NEEDED, relight
from fabricusd.bake.layout.garment import garments
from fabricusd.bake.texels.blocks import bake_block
from fabricusd.bake.texels.layers import Place, TableLayer, layer_of
from fabricusd.bake.texels.maps import REGISTRY, chosen_maps
from fabricusd.bake.texels.moment_indices import COVER, HORIZON, MOMENTS, SHARE
from fabricusd.bake.texels.moments import texels
from fabricusd.bake.texels.recipe import recipe
from fabricusd.bake.texels.sheet import sheets_of, texel_start, texel_step
from fabricusd.errors import FabricError
from fabricusd.fabric import even
from fabricusd.quality.colors import delta_e_2000
from fabricusd.schema import load as load_preset
from fabricusd.schema import published_names
from tests.appearance.presets import often
from tests.bake.meshes import quad_scene

PUBLISHED = (
    "linen_plain",
    "silk_crepe_de_chine",
    "polyester_satin_charmeuse",
    "polyester_satin_charmeuse_back",
    "silk_shot",
    "velvet",
)


def load(name):
    """A preset of even threads, which every repeat repeats."""
    return even(load_preset(name))


def baked(fabric, threads=8.0, resolution=128, names=None, **options):
    """Maps of a square, every one where not named: name -> list of levels."""
    settings = {k: options.pop(k) for k in ("level", "light") if k in options}
    one = garments(quad_scene(fabric, threads, **options))[0]
    sheet = sheets_of(one, (recipe(fabric, **settings),), {1001: (0, 0)}, resolution, 4)[0]
    maps = chosen_maps(names, light="light" in settings)
    found, _, _ = bake_block(sheet, maps, 0, 0)
    return {t.name: levels for t, levels in zip(maps, found, strict=True)}, sheet


def test_every_map_is_finite_and_has_a_meaning():
    for name in ("linen_plain", "velvet"):
        maps, _ = baked(load(name))
        for key, levels in maps.items():
            assert REGISTRY[key].meaning
            assert [a.shape[0] for a in levels] == [128 >> k for k in range(8)]
            assert all(np.isfinite(a).all() for a in levels), key


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_coarsest_level_holds_the_fabrics_own_shares(name):
    fabric = load(name)
    maps, _ = baked(fabric, threads=float(np.lcm.reduce(true_repeat(fabric)) * 2))
    share = coverage(fabric)
    top = maps["opacity"][-1][0, 0, 0]
    assert top == pytest.approx(1.0 - share.gap, abs=0.01)
    for which, noun in enumerate(("weft", "warp")):
        assert maps[f"{noun}_thread"][-1][0, 0, 3] == pytest.approx(share.area[which], abs=0.01)
        assert maps[f"{noun}_share"][-1][0, 0].sum() == pytest.approx(share.area[which], abs=0.01)


def test_mean_albedo_is_the_reflectance_of_level_far():
    fabric = load("linen_plain")
    maps, _ = baked(fabric)
    z, weight = np.polynomial.legendre.leggauss(32)
    z = 0.5 * (z + 1)
    phi = (np.arange(64) + 0.5) * 2 * np.pi / 64
    flat = np.sqrt(1 - z * z)[:, None]
    wi = np.stack(np.broadcast_arrays(flat * np.cos(phi), flat * np.sin(phi), z[:, None]), axis=-1)
    wi = wi.reshape(-1, 3)
    value = evaluate(fabric, wi, (0.0, 0.0, 1.0), shadow=mean_shadow(fabric)).reshape(32, 64, 3)
    true = np.einsum("k,kac->c", 0.5 * weight, value) * 2 * np.pi / 64
    assert np.allclose(maps["albedo"][-1][0, 0], true, rtol=0.02)


def test_normals_are_those_of_the_height_map():
    # Long floats without gaps: no step of the height between neighbours along a thread.
    fabric = load("linen_plain")
    maps, _ = baked(fabric, threads=4.0, resolution=256)
    # Quarter of a mm a texel in reality: slopes need the cloth's own scale.
    step = fabric.warp.pitch * 4.0 / 256 * 1e3
    height = maps["height"][0][..., 0].astype(np.float64)
    normal = maps["normal"][0].astype(np.float64)
    ids = maps["thread_id"][0][..., 0]
    full = maps["opacity"][0][..., 0] == 1
    middle = (slice(1, -1), slice(1, -1))
    same = full[middle] & (ids[middle] != NO_THREAD)
    for shift in (-1, 1):
        for axis in (0, 1):
            same &= (np.roll(ids, shift, axis) == ids)[middle]
            same &= (np.roll(full, shift, axis))[middle]
    du = (height[1:-1, 2:] - height[1:-1, :-2]) / (2 * step)
    dv = (height[:-2, 1:-1] - height[2:, 1:-1]) / (2 * step)
    got = -normal[middle][..., :2] / normal[middle][..., 2:]
    error = np.abs(got - np.stack((du, dv), axis=-1))[same]
    assert same.mean() > 0.3
    assert np.quantile(error, 0.95) < 0.03


def test_a_turned_grain_turns_the_tangents():
    fabric = load("silk_shot")
    straight, _ = baked(fabric)
    turned, _ = baked(fabric, rotation=np.pi / 2)
    a, c = straight["tangent"][-1][0, 0], turned["tangent"][-1][0, 0]
    assert abs(float(a[0] * c[0] + a[1] * c[1])) < 0.05


def test_a_mip_normal_is_the_mean_slope_and_not_the_mean_normal():
    """A symmetric hump has no mean slope; what its slopes do instead is in their variance."""
    fabric = load("linen_plain")
    maps, _ = baked(fabric)
    assert np.allclose(maps["normal"][-1][0, 0], (0, 0, 1), atol=2e-3)
    fine = maps["normal"][0].astype(np.float64).mean(axis=(0, 1))
    assert np.linalg.norm(fine) < 0.98
    # Slopes of linen are even from -25 to 25 degrees in angle: E[tan^2] over both sets' shares.
    psi = np.radians(np.linspace(-25, 25, 4001))
    share = coverage(fabric).area
    expected = np.mean(np.tan(psi) ** 2) * share / share.sum()
    assert np.allclose(maps["slope_variance"][-1][0, 0, :2], expected, rtol=0.03)


def test_shadows_cross_the_repeats_border():
    """Repeat after repeat looks alike: no seam where the table ends."""
    fabric = load("linen_plain")
    maps, _ = baked(fabric, threads=8.0, resolution=128)
    seen = maps["visibility"][0][..., 0].astype(np.float64)
    shift = 128 * 2 // 8
    inside = np.abs(seen - np.roll(seen, shift, axis=1))
    assert inside.mean() < 0.005
    # The twin: half a repeat on, other threads lie there.
    assert np.abs(seen - np.roll(seen, shift // 2, axis=1)).mean() > 0.01


def test_a_place_at_the_repeats_border_is_shadowed_by_the_next_repeat():
    """Light from -U, low: what stands in its way lies in the repeat before. Against marching."""
    fabric = load("linen_plain")
    maps, sheet = baked(fabric, threads=16.0, resolution=256)
    towards_minus_u = maps["horizon_08"][0][..., 0].astype(np.float64)
    places = np.random.default_rng(0).random((200_000, 2)) * 256
    uv = texel_start(sheet, 0, 0, 0) + places @ texel_step(sheet, 0).T
    elevation = np.radians(10.0)
    wi = np.array([-np.cos(elevation), 0.0, np.sin(elevation)])
    for low, high in ((0.0, 0.25), (1.0, 1.25)):
        inside = ~lookup(fabric, uv).gap & (uv[:, 0] % 2.0 >= low) & (uv[:, 0] % 2.0 < high)
        light = np.repeat(wi[None], inside.sum(), axis=0)
        true, table = (
            shadowing(fabric, light, uv[inside], m).mean() for m in ("traced", "horizon")
        )
        x, y = places[inside].T.astype(int)
        lit = wi[2] >= towards_minus_u[y, x]
        assert true < 0.8
        # The strips beside the threads on top, where the table that is baked is off by .06.
        assert lit.mean() == pytest.approx(table, abs=0.05)
        assert lit.mean() == pytest.approx(true, abs=0.08)


def test_a_low_light_casts_longer_shadows():
    fabric = load("linen_plain")
    high, _ = baked(fabric, light=(0.2, 0.1, 1.0))
    low, _ = baked(fabric, light=(1.0, 0.1, 0.3))
    assert low["shadow"][-1][0, 0, 0] < high["shadow"][-1][0, 0, 0] - 0.05


RELIT_EVERY_RUN = ("linen_plain", 16.0), ("polyester_satin_charmeuse", 1.5)


@pytest.mark.parametrize(
    ("name", "texels_per_thread"),
    [
        pytest.param(*pair, marks=() if pair in RELIT_EVERY_RUN else pytest.mark.exhaustive)
        for pair in itertools.product(published_names(), (1.5, 16.0))
    ],
)
def test_a_relit_set_is_within_its_stated_bound_on_pairs_held_back(name, texels_per_thread):
    fabric = load(name)
    one = garments(quad_scene(fabric, 64 / texels_per_thread))[0]
    sheet = sheets_of(one, (recipe(fabric),), {1001: (0, 0)}, 64, 4)[0]
    stated = swatch_error(sheet)
    held_back = swatch_error(sheet, pairs=pairs_between(20, skip=PAIRS))
    assert held_back.worst_pair <= stated.bound
    if texels_per_thread == 16.0:
        # Under laws that do not mask, the mean shadow steps along a thread: .58 of linen, .44 as
        # it was published.
        assert stated.texel < (0.7 if mean_shadow(fabric) == "horizon" else 0.5)


def test_the_bound_bites_when_the_maps_are_of_another_fabric():
    fabric = load("linen_plain")
    other = replace(
        fabric,
        threads={n: replace(t, albedo=(0.2, 0.1, 0.1)) for n, t in fabric.threads.items()},
    )
    one = garments(quad_scene(fabric, 16.0))[0]
    right = sheets_of(one, (recipe(fabric),), {1001: (0, 0)}, 256, 4)[0]
    wrong = sheets_of(one, (recipe(other),), {1001: (0, 0)}, 256, 4)[0]
    assert swatch_error(wrong).worst_pair > 5 * swatch_error(right).bound


@pytest.mark.parametrize("name", often(published_names()))
def test_the_coarsest_level_relit_is_level_far(name):
    fabric = load(name)
    maps, _ = baked(fabric, names=NEEDED, resolution=64, threads=float(2 * true_repeat(fabric)[0]))
    top = {k: maps[k][-1].reshape(1, -1) for k in NEEDED}
    top["thread_id"] = np.full_like(top["thread_id"], NO_THREAD)
    found = [
        delta_e_2000(
            display(relight(top, fabric, wi, wo), wi),
            display(evaluate(fabric, wi, wo, shadow=mean_shadow(fabric)), wi),
        )[0]
        for wi, wo in zip(*pairs_between(40), strict=True)
    ]
    assert np.mean(found) < 0.5


def test_255_which_stood_for_no_thread_once_is_relit_as_none():
    fabric = load("linen_plain")
    maps, _ = baked(fabric, names=NEEDED, resolution=64, threads=4.0)
    top = {k: maps[k][-1].reshape(1, -1) for k in NEEDED}
    found = [
        relight(
            {**top, "thread_id": np.full_like(top["thread_id"], none)}, fabric, *[(0, 0, 1)] * 2
        )
        for none in (NO_THREAD, 255)
    ]
    assert np.array_equal(*found)
    assert found[0].max() > 0


def test_ids_and_coordinates_are_those_of_the_texels_centre_at_every_level():
    fabric = load("polyester_satin_charmeuse")
    maps, _ = baked(fabric, threads=10.0)
    for level in range(5):
        weave = maps["weave_coordinate"][level]
        size = len(weave)
        y, x = np.mgrid[0:size, 0:size] + 0.5
        true = np.stack((x, size - y), axis=-1) / size * 10.0
        assert np.allclose(weave, np.mod(true, 5.0), atol=1e-5)
        hit = lookup(fabric, true.reshape(-1, 2))
        ids = maps["thread_id"][level].ravel()
        expected = np.where(hit.gap, NO_THREAD, hit.thread + 2 * (hit.set == 1))
        assert (ids == expected).mean() > 0.995


def test_unknown_maps_and_a_shadow_without_a_light_are_refused():
    with pytest.raises(FabricError, match="must be one of thread_id"):
        chosen_maps(("colour",), light=False)
    with pytest.raises(FabricError, match="needs a light"):
        chosen_maps(("shadow",), light=False)


@pytest.mark.parametrize(("name", "threads"), [("linen_plain", 64.0), ("velvet", 90.0)])
def test_looked_up_texels_are_those_computed_one_by_one(name, threads):
    """Means of many texels, since those that are computed have the noise of 16 samples."""
    fabric = load(name)
    uv = np.array([[0.1, 0.1], [0.55, 0.1], [0.6, 0.8], [0.1, 0.9]])
    one = garments(quad_scene(fabric, threads, uv=uv, rotation=0.3))[0]
    looked_up = sheets_of(one, (recipe(fabric),), {1001: (0, 0)}, 256, 4)[0]
    assert looked_up.tables[0] is not None
    computed = replace(looked_up, tables=(None,))
    maps = chosen_maps(None, light=False)
    found = [bake_block(sheet, maps, 0, 0) for sheet in (looked_up, computed)]
    for k, one_map in enumerate(maps):
        for level in range(9):
            a, c = (blocks[0][k][level].astype(np.float64) for blocks in found)
            if one_map.exact:
                assert np.array_equal(a, c)
            elif one_map.name not in ("tangent", "anisotropy", "roughness_along"):
                assert np.abs(a - c).mean() < 0.02 + 0.2 * c.std(), (one_map.name, level)
    assert np.allclose(found[0][1], found[1][1], rtol=0.02, atol=0.01)
    assert np.array_equal(found[0][2], found[1][2])


def test_a_texel_of_the_table_is_the_mean_over_its_own_area():
    """Against a thousand samples, at half a texel a thread and at six."""
    fabric = load("polyester_satin_charmeuse")
    made = recipe(fabric)
    for threads in (0.5, 6.0):
        one = garments(quad_scene(fabric, 1024.0 / threads, rotation=0.2))[0]
        sheet = sheets_of(one, (made,), {1001: (0, 0)}, 1024, 4)[0]
        place = Place(sheet=sheet, lay=0, window=sheet.window(1, 1))
        owned = np.ones((256, 256), np.float32)
        got = layer_of(place, owned)
        assert isinstance(got, TableLayer)
        for j, i in np.random.default_rng(0).integers(0, 256, (20, 2)):
            step = texel_step(sheet, 0)
            start = texel_start(sheet, 0, 256 + i, 256 + j)
            true = np.empty((MOMENTS, 1, 1), np.float32)
            nobody, sums = np.zeros((1, 1), np.int32), np.empty(MOMENTS, np.float32)
            texels(made, step, step, start, (i, j), nobody, 0, 32, sums, true)
            error = np.abs(got.moments_at(j, i) - true[:, 0, 0])
            assert error[COVER] < 0.05
            assert error[SHARE : SHARE + 8].max() < 0.08
            assert error[HORIZON:].max() < 0.08


def test_uneven_threads_are_baked_as_the_lookup_finds_them():
    """By the cell table, which knows even threads only, and texel by texel."""
    fabric = load_preset("linen_plain")
    names = ["thread_id", "opacity", "albedo", "warp_thread"]
    maps, sheet = baked(fabric, threads=200.0, resolution=2048, names=names)
    assert sheet.tables[0] is not None
    size = sheet.block_side
    x, y = (k.ravel() + 0.5 for k in np.meshgrid(np.arange(size), np.arange(size)))
    uv = texel_start(sheet, 0, 0.0, 0.0) + np.stack((x, y), axis=1) @ texel_step(sheet, 0).T
    hit = lookup(fabric, uv)
    number = np.where(hit.gap, NO_THREAD, hit.thread + len(fabric.threads) * (hit.set == 1))
    assert (maps["thread_id"][0].ravel() == number).mean() > 0.999
    regular, _ = baked(even(fabric), threads=200.0, resolution=2048, names=names)
    assert (regular["thread_id"][0].ravel() == number).mean() < 0.97
    one_by_one = replace(sheet, tables=(None,))
    exact, _, _ = bake_block(one_by_one, chosen_maps(names, light=False), 0, 0)
    true = {t.name: a for t, a in zip(chosen_maps(names, light=False), exact, strict=True)}
    for name in ("albedo", "warp_thread", "opacity"):
        for level in (0, 3):
            off, apart = (
                float(np.std(a[name][level].astype(float) - true[name][level]))
                for a in (maps, regular)
            )
            assert off < 0.5 * apart, (name, level)


def test_a_bake_of_uneven_threads_keeps_the_colour_of_even_ones():
    for name in ("linen_plain", "rayon_shantung"):
        fabric = load_preset(name)
        uneven, regular = (
            baked(f, threads=64.0, resolution=256, names=["albedo", "opacity"])[0]
            for f in (fabric, even(fabric))
        )
        for key in ("albedo", "opacity"):
            assert uneven[key][-1][0, 0] == pytest.approx(regular[key][-1][0, 0], rel=0.015), key


@pytest.mark.parametrize("rotation", [0.0, 30.0])
@pytest.mark.parametrize("name", ["polyester_satin_charmeuse", "silk_shot"])
def test_neighbouring_tangents_do_not_differ_in_sign_alone(name, rotation):
    """Or filtering them would cancel them."""
    maps, _ = baked(load(name), threads=16.0, level="thread", rotation=np.radians(rotation))
    tangent = maps["tangent"][0][..., :2].astype(np.float64)
    for axis in (0, 1):
        beside = (tangent * np.roll(tangent, 1, axis=axis)).sum(axis=-1)
        assert (beside < -0.9).mean() < 0.01
    # The twin: signs by the first coordinate alone.
    if name == "polyester_satin_charmeuse" and rotation == 0:
        other = tangent * np.where(tangent[..., :1] < -1e-6, -1.0, 1.0)
        assert ((other * np.roll(other, 1, axis=1)).sum(axis=-1) < -0.9).mean() > 0.02
