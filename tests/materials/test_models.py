"""The standard surfaces in NumPy, and the fit to a fabric."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fabricusd.appearance.weave.coverage import coverage
from fabricusd.bake.layout.garment import garments
from fabricusd.bake.texels.maps import REGISTRY, Texels
from fabricusd.bake.texels.recipe import recipe
from fabricusd.materials.fit.fit import fit, fit_threads, with_threads
from fabricusd.materials.fit.forward import forward
from fabricusd.materials.fit.judge import LIGHTS, SKY, VIEWS, Judge, direction_pairs, hemisphere
from fabricusd.materials.fit.models import KINDS, Surface, evaluate
from fabricusd.materials.fit.target import TexelSample, target_of
from fabricusd.materials.fit.texels import KINDS as KINDS_OF_TEXELS
from fabricusd.materials.fit.texels import NEEDED, _kinds
from fabricusd.materials.networks.look import Look
from fabricusd.schema import load, published_names
from tests.appearance.presets import LINEN, often
from tests.bake.meshes import quad_scene


def white(alpha=(0.3, 0.6), ior=1.5, fuzz=0.0):
    one = np.ones(1)
    return Surface(
        base=np.ones((1, 3)), ior=ior * one, alpha_smooth=alpha[0] * one,
        alpha_rough=alpha[1] * one, tint=np.ones((1, 3)), fuzz_weight=fuzz * one,
        fuzz_color=np.ones((1, 3)), fuzz_roughness=0.5 * one,
    )  # fmt: skip


def albedo(kind, surface, view):
    wi = hemisphere(20000)
    values = evaluate(kind, surface, wi, np.broadcast_to(view, wi.shape))
    return values.mean(axis=0) * 2 * np.pi


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("degrees", [0.0, 40.0, 70.0])
def test_a_white_surface_reflects_nearly_all_light(kind, degrees):
    angle = np.radians(degrees)
    view = np.array([np.sin(angle), 0.0, np.cos(angle)])
    for fuzz in (0.0, 0.7):
        # The layers' albedos are MaterialX's own rational fits, good to a few per cent.
        got = albedo(kind, white(fuzz=fuzz, alpha=(0.4, 0.4)), view)
        assert got == pytest.approx(np.ones(3), abs=0.06)


def test_below_the_surface_there_is_nothing():
    down, up = np.array([[0.0, 0.6, -0.8]]), np.array([[0.0, 0.6, 0.8]])
    for kind in KINDS:
        assert not evaluate(kind, white(), down, up).any()
        assert not evaluate(kind, white(), up, down).any()


def test_the_highlight_is_longer_along_the_rougher_axis():
    view = np.array([[0.0, 0.0, 1.0]])
    s = np.sin(np.radians(50.0))
    glossy = replace(white(), base=np.zeros((1, 3)))
    along = evaluate("openpbr", glossy, np.array([[s, 0, np.sqrt(1 - s * s)]]), view)
    across = evaluate("openpbr", glossy, np.array([[0, s, np.sqrt(1 - s * s)]]), view)
    assert (along > across * 1.5).all()


VALUES = json.loads(Path(__file__).with_name("materialx_values.json").read_text())


@pytest.mark.parametrize("row", VALUES["rows"], ids=lambda r: r["kind"])
def test_values_are_those_of_the_shaders_that_materialx_generates(row):
    """`bench/materials/materialx_values.py` ran them; they compute in float32."""
    s, kind = row["surface"], row["kind"]
    one = np.ones(len(VALUES["wi"]))
    # UsdPreviewSurface knows neither anisotropy nor a tint.
    rough, tint = (s["smooth"], [1.0] * 3) if kind == "preview" else (s["rough"], s["tint"])
    made = Surface(
        base=np.array(s["base"]), ior=s["ior"] * one, alpha_rough=rough * one,
        alpha_smooth=s["smooth"] * one, tint=np.array(tint),
        fuzz_weight=s["fuzz_weight"] * one, fuzz_color=np.array(s["fuzz_color"]),
        fuzz_roughness=s["fuzz_roughness"] * one,
    )  # fmt: skip
    got = evaluate(kind, made, np.array(VALUES["wi"]), np.array(VALUES["wo"]))
    assert np.allclose(got, row["values"], rtol=2e-4, atol=1e-6)


def texels(**changes):
    made = TexelSample(
        base=np.full((1, 3), 0.4), smooth=np.full(1, 0.6), rough=np.full(1, 0.8),
        opacity=np.ones(1), normal=np.array([[0.0, 0, 1]]), tangent=np.array([[1.0, 0, 0]]),
        weight=np.ones(1),
    )  # fmt: skip
    return replace(made, **changes)


@pytest.mark.parametrize("kind", ["openpbr", "preview"])
def test_a_fit_returns_the_surface_that_made_the_data(kind, monkeypatch):
    truth = Look(
        base_color_scale=(0.5, 0.8, 1.2), specular_ior=2.0, smooth_scale=0.8, rough_scale=1.0
    )
    wi, wo = direction_pairs()
    made = forward(kind, truth, texels(), wi[None], wo[None])[0]
    monkeypatch.setattr("fabricusd.materials.fit.target.surface.evaluate", lambda *_, **__: made)
    found = fit(kind, texels(), load("linen_plain"))
    assert found.delta_e < 0.3
    assert found.albedo < 0.01
    assert found.look.specular_ior == pytest.approx(2.0, abs=0.1)
    assert found.look.smooth_scale == pytest.approx(0.8, abs=0.05)


def test_a_fit_to_cloth_is_nearer_than_the_textures_alone():
    found = fit("openpbr", texels(base=np.array([[0.05, 0.2, 0.25]])), load("linen_plain"))
    assert found.delta_e < 0.8 * found.start_delta_e
    assert found.albedo < 0.2


@cache
def far_texel(fabric):
    """The texel that spans many repeats of a fabric."""
    made = recipe(fabric)
    lay = garments(quad_scene(fabric, 6400.0))[0].lays[0]
    mean = Texels.of_moments(made.mean[:, None], made, lay)
    value = {name: REGISTRY[name].function(mean).astype(np.float64) for name in NEEDED}
    x, y, _ = value["tangent"].T
    return TexelSample(
        base=value["base_color"], smooth=value["roughness_along"][:, 0],
        rough=value["roughness_across"][:, 0], opacity=value["opacity"][:, 0],
        normal=value["normal"], tangent=np.stack((-y, x, 0 * x), axis=1), weight=np.ones(1),
    )  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", often(published_names(), LINEN))
def test_a_fit_is_never_worse_than_the_textures_alone(name, kind, monkeypatch):
    # Few steps and directions: it must hold wherever the search ends.
    for constant, few in (
        ("fit.fit.FIRST", 2),
        ("fit.fit.MORE", 2),
        ("fit.judge.VIEWS", 6),
        ("fit.judge.LIGHTS", 32),
    ):
        monkeypatch.setattr(f"fabricusd.materials.{constant}", few)
    fabric = load(name)
    found = fit(kind, far_texel(fabric), fabric)
    assert found.delta_e <= found.start_delta_e
    assert found.score <= found.start_score


def test_residuals_are_a_mean_squared_delta_e():
    """Near the target, where delta E 2000 is what they were made from; greys and colours."""
    rng = np.random.default_rng(0)
    base = rng.uniform(0.1, 0.3, (2, VIEWS * LIGHTS, 3))
    base[0] = base[0, :, :1]
    judge = Judge(base, np.array([1.0, 3.0]))
    near = base * 1.01
    squares = judge.delta_e(near) ** 2
    sky = judge.delta_e_of_sky(near) ** 2
    each = (1.0 - SKY) * squares.mean(axis=1) + SKY * sky.mean(axis=1)
    expected = np.array([0.25, 0.75]) @ each
    assert np.sum(judge.residuals(near) ** 2) == pytest.approx(expected, rel=0.1)
    assert judge.score(base) == 0.0


def test_kinds_of_texels_keep_the_mean_and_share_out_the_whole():
    rows = np.random.default_rng(2).normal(size=(500, 4))
    means, share = _kinds(rows)
    assert len(means) <= KINDS_OF_TEXELS
    assert share.sum() == pytest.approx(1.0)
    assert share @ means == pytest.approx(rows.mean(axis=0))
    alike, one = _kinds(np.tile([0.5, 0.25], (500, 1)))
    assert alike.tolist() == [[0.5, 0.25]]
    assert one.tolist() == [1.0]


def test_half_the_cover_is_half_the_light():
    wi, wo = (w[None] for w in direction_pairs())
    whole = forward("openpbr", Look(), texels(), wi, wo)
    half = forward("openpbr", Look(), texels(opacity=np.full(1, 0.5)), wi, wo)
    assert np.allclose(half, 0.5 * whole)


def two_threads():
    """Shot silk's texels: flat warp, and weft at three angles; as a bake that resolves them has."""
    lean = np.radians([0.0, -20.0, 0.0, 20.0])
    normal = np.stack((np.sin(lean), 0 * lean, np.cos(lean)), axis=1)
    return TexelSample(
        base=np.array([[0.9, 0.05, 0.1]] + 3 * [[0.1, 0.5, 0.2]]), smooth=np.full(4, 0.5),
        rough=np.full(4, 0.8), opacity=np.ones(4), normal=normal,
        tangent=np.tile([0.0, 1.0, 0.0], (4, 1)), weight=np.array([0.14, 0.28, 0.3, 0.28]),
        thread=np.array([3, 0, 0, 0]),
    )  # fmt: skip


def test_the_mean_of_the_threads_rows_is_level_far():
    fabric = load("silk_shot")
    target = target_of(fabric, two_threads())
    area = coverage(fabric).area
    both = area[0] * target.values[1] + area[1] * target.values[2]
    assert np.abs(both - target.values[0]).mean() < 0.05 * target.values[0].mean()
    assert target.weight == pytest.approx([1.0, 0.86, 0.14])
    assert target.members.sum(axis=1) == pytest.approx(1.0)


@pytest.mark.exhaustive
def test_threads_of_two_colours_are_fitted_better_one_by_one(monkeypatch):
    monkeypatch.setattr("fabricusd.materials.fit.judge.VIEWS", 6)
    monkeypatch.setattr("fabricusd.materials.fit.judge.LIGHTS", 48)
    fabric, baked = load("silk_shot"), two_threads()
    threads = fit_threads(baked, fabric)
    weft, warp = threads[0].look, threads[3].look
    assert weft.specular_ior == warp.specular_ior
    # The weft is green, the warp red.
    assert weft.specular_tint[1] > weft.specular_tint[0]
    assert warp.specular_tint[0] > warp.specular_tint[1]
    looks = {one: fitted.look for one, fitted in threads.items()}
    together = fit("openpbr", baked, fabric)
    apart = fit("openpbr", with_threads(baked, looks), fabric, baked=baked)
    assert apart.start_score == pytest.approx(together.start_score)
    assert apart.threads_delta_e < 0.9 * together.threads_delta_e
    assert apart.score < together.score
