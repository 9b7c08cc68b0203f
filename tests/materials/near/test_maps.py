"""Textures of threads, from a bake and from one repeat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from materials import scenes
from materials.near.swatches import bake_square

from fabricusd.appearance import surface
from fabricusd.fabric import even
from fabricusd.images.files import read_mip_level
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.near import maps as near_maps
from fabricusd.materials.near.maps import LEAN, NEEDED, SHARES, TINTS, texels_of, why_not
from fabricusd.materials.near.parts import mean_of, parts_of
from fabricusd.materials.near.repeat import repeat_layers
from fabricusd.schema import load


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    """A square of uneven linen at eight texels a thread, its textures, and its parts."""
    folder = tmp_path_factory.mktemp("square")
    maps = bake_square(folder, load("linen_plain"), threads=16.0, resolution=128)
    files, parts = near_maps.write_near_maps(maps, folder)
    return maps, {name: one[next(iter(one))] for name, one in files.items()}, parts[0]


def layers(files, level=0):
    return {name: read_mip_level(path, level) for name, path in files.items()}


def test_the_shares_are_those_of_the_bake(baked):
    maps, files, _ = baked
    for name, noun in zip(SHARES, ("weft", "warp"), strict=True):
        truth = read_mip_level(next(iter(maps.textures[f"{noun}_share"].values())))
        assert np.array_equal(read_mip_level(files[name]), truth)


def test_the_moments_of_the_angle_are_those_of_the_bake(baked):
    maps, files, parts = baked
    share, angle, spread = (
        read_mip_level(next(iter(maps.textures[f"warp_{kind}"].values())))
        for kind in ("share", "angle", "spread")
    )
    lean = read_mip_level(files[LEAN])
    off = angle - parts.angle[4:]
    assert lean[..., 2] == pytest.approx((share * off).sum(axis=2), abs=1e-4)
    assert lean[..., 3] == pytest.approx((share * (off**2 + spread**2)).sum(axis=2), abs=1e-4)


def test_the_coarsest_level_is_the_whole_cloth(baked):
    _, files, parts = baked
    coarsest = texels_of(layers(files, 7))
    whole = parts.texel
    for name in ("share", "lean", "spread", "tint"):
        # Half floats have eleven bits.
        assert getattr(coarsest, name) == pytest.approx(getattr(whole, name), rel=1e-3, abs=1e-5)


def test_coarser_levels_are_means_of_finer_ones(baked):
    _, files, _ = baked
    for name in files:
        fine, coarse = read_mip_level(files[name], 2), read_mip_level(files[name], 3)
        assert coarse == pytest.approx(near_maps.halved(fine), rel=2e-3, abs=1e-4)


def test_uneven_yarn_has_tints_of_mean_1(baked):
    _, files, _ = baked
    texels = texels_of(layers(files))
    seen = texels.sets[:, 0] > 0.5
    tint = texels.tint[seen, 0, 1] / texels.sets[seen, 0]
    assert tint.mean() == pytest.approx(1.0, abs=0.03)
    assert 0.01 < tint.std() < 0.2


def test_outside_the_layout_is_the_mean_of_the_lay(tmp_path):
    maps = bake_square(tmp_path, load("linen_plain"), threads=8.0, resolution=64, width=0.5)
    files, parts = near_maps.write_near_maps(maps, tmp_path)
    pixels = read_mip_level(next(iter(files[SHARES[0]].values())))
    outside = read_mip_level(next(iter(maps.textures["lay"].values())))[..., 0] == 255
    assert 0.2 < outside.mean() < 0.8
    whole = np.broadcast_to(parts[0].share[:4], (outside.sum(), 4))
    assert pixels[outside] == pytest.approx(whole, abs=1e-3)
    assert pixels[~outside].std(axis=0).min() > 0.1


def test_each_fabric_of_a_garment_has_its_own_parts_on_every_tile(tmp_path, monkeypatch):
    """The first face wears linen, the second velvet, and the tiles part within the second."""
    monkeypatch.setattr(scenes, "MAPS", (*scenes.MAPS, *NEEDED))
    _, folder = scenes.bake_shirt(tmp_path, udim=True)
    maps = read_bake_folder(folder).garments[0]
    files, parts = near_maps.write_near_maps(maps, tmp_path)
    assert sorted(path.name for path in files[LEAN].values()) == [
        "Body.lobes_lean.1001.exr", "Body.lobes_lean.1002.exr",
    ]  # fmt: skip
    for one, name in zip(parts, ("linen_plain", "velvet"), strict=True):
        truth = parts_of(load(name))
        assert one.share == pytest.approx(truth.share, abs=0.05)
        seen = (truth.share > 0.05) & (one.share > 0)
        assert one.angle[seen] == pytest.approx(truth.angle[seen], abs=0.1)
    for tile, path in files[SHARES[0]].items():
        lay = read_mip_level(maps.textures["lay"][tile])[..., 0]
        for number in np.unique(lay[lay < 2]).astype(int):
            mean = read_mip_level(path)[lay == number].mean(axis=0)
            assert mean == pytest.approx(parts[number].share[:4], abs=0.1)


@pytest.mark.parametrize("lost", ["weft_share", "warp_spread"])
def test_a_bake_without_the_maps_says_which_it_lacks(baked, lost):
    maps = baked[0]
    textures = {name: one for name, one in maps.textures.items() if name != lost}
    assert why_not(maps) is None
    assert why_not(replace(maps, textures=textures)) == f"the bake lacks {lost}"


def test_a_bake_that_does_not_resolve_threads_says_so(baked):
    maps = baked[0]
    lay = replace(maps.lays[0], matrix=10.0 * maps.lays[0].matrix)
    assert why_not(replace(maps, lays=(lay,))) == "a texel of the bake spans 1.2 threads"


def test_a_repeat_has_the_parts_of_the_fabric():
    fabric = even(load("silk_shot"))
    _, parts = repeat_layers(fabric)
    truth = parts_of(fabric)
    assert parts.share == pytest.approx(truth.share, abs=0.01)
    seen = truth.share > 0
    assert parts.angle[seen] == pytest.approx(truth.angle[seen], abs=0.01)


def test_the_first_pick_of_a_repeat_is_below():
    fabric = load("silk_shot")
    pixels, _ = repeat_layers(fabric)
    size = len(pixels[LEAN])
    rows = np.random.default_rng(1).integers(0, size, (200, 2))
    ends, picks = 2, 2
    uv = np.stack(
        ((rows[:, 1] + 0.5) / size * ends, (1.0 - (rows[:, 0] + 0.5) / size) * picks), axis=1
    )
    warp = surface.places_of(even(fabric), uv).set == 1
    share = pixels[SHARES[1]][rows[:, 0], rows[:, 1]].sum(axis=1)
    inside = np.abs(share - 0.5) > 0.45
    assert inside.mean() > 0.9
    assert np.array_equal(warp[inside], share[inside] > 0.5)


def test_even_threads_of_one_color_have_no_tints_and_others_have():
    assert not set(TINTS) & set(repeat_layers(load("linen_plain"))[0])
    fabric = load("silk_shot")
    assert near_maps.tinted_sets(fabric)
    assert not near_maps.tinted_sets(even(fabric))


def test_the_mean_of_the_texels_of_a_repeat_is_its_whole():
    pixels, parts = repeat_layers(load("linen_plain"))
    mean = mean_of(texels_of(pixels))
    assert mean.share[0] == pytest.approx(parts.share, abs=1e-6)
    assert mean.lean[0] == pytest.approx((0.0, 0.0), abs=1e-6)
    assert mean.spread[0] == pytest.approx(parts.spread, rel=1e-4)
