"""Where the model fails: no NaN, no infinity, no negative value, the limits documented there."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.appearance import plain, surface
from fabricusd.appearance.published.far import far_values
from fabricusd.appearance.published.levels import point_values
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering import models
from fabricusd.appearance.scattering.model import PUBLISHED as LAW
from fabricusd.appearance.weave.place import Places
from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, MODELS, Fabric, TangentCurve, Thread, ThreadSet, Weave
from tests.appearance.directions import VIEWS, direction, random_directions
from tests.appearance.presets import PRESETS, often, with_model

PLACES = np.random.default_rng(3).random((4000, 2)) * 20
PUBLISHED = models.names(LAW)

SPECIAL = np.array(
    [
        (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, -1),
        direction(89.9, 0), direction(89.9, 180), direction(89.9999, 90), direction(89.9999, 270),
        direction(25, 0), direction(65, 180), direction(55, 90), direction(90 - 1e-9, 45),
        direction(45, 45), direction(135, 225),
    ]
)  # fmt: skip
"""Along the threads and their tangents at 25 and 35 degrees, across, at the horizon, opposite."""


def sound(value):
    return bool(np.isfinite(value).all() and (value >= 0).all())


def pairs_of(w):
    i, o = np.meshgrid(np.arange(len(w)), np.arange(len(w)))
    return w[i.ravel()], w[o.ravel()]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("level", surface.LEVELS)
def test_special_directions_give_sound_values(model, level):
    wi, wo = pairs_of(SPECIAL)
    for name, preset in PRESETS.items():
        fabric = with_model(preset, model)
        for place in PLACES[:2]:
            value = surface.evaluate(fabric, wi, wo, uv=place, level=level)
            assert sound(value), name
            density = surface.pdf(fabric, wi, wo, uv=place, level=level)
            assert sound(density), name


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("model", often(PUBLISHED, PUBLISHED[:1]))
def test_two_million_random_pairs_on_every_fabric_give_sound_values(model, precision):
    n = 2_000_000 // len(PRESETS)
    wi = random_directions(n, 1, upper=False).T.astype(precision, order="C")
    wo = random_directions(n, 2, upper=False).T.astype(precision, order="C")
    out = np.empty_like(wi)
    for name, preset in PRESETS.items():
        tables = surface_tables(with_model(preset, model), precision=precision)
        far_values(precision, tables, wi, wo, out, 0, n)
        assert sound(out), name
        angle = np.linspace(-math.pi / 2, math.pi / 2, n).astype(precision)
        across = np.linspace(-1, 1, n).astype(precision)
        sets = (np.arange(n) % 3).astype(np.uint8)
        threads = (np.arange(n) % 2).astype(np.int32)
        places = Places(sets, threads, angle, across)
        point_values(precision, tables, True, places, wi, wo, out, 0, n)
        assert sound(out), name


@pytest.mark.parametrize("model", PUBLISHED)
@pytest.mark.parametrize("level", surface.LEVELS)
def test_the_published_models_are_nothing_at_and_below_the_cloth(model, level):
    above, below = direction(30, 10), direction(120, 10)
    level_with_it = np.array([1.0, 0.0, 0.0])
    fabric = with_model(PRESETS["velvet"], model)
    for wi, wo in ((above, below), (below, above), (below, below), (above, level_with_it)):
        assert (surface.evaluate(fabric, wi, wo, uv=PLACES[0], level=level) == 0).all()
        assert surface.pdf(fabric, wi, wo, uv=PLACES[0], level=level) == 0


def test_conserving_cloth_lets_light_through_unless_it_is_opaque():
    below = direction(150, 10)
    thin = with_model(PRESETS["silk_shot"], "conserving")
    for fabric, light in ((thin, True), (replace(thin, opaque=True), False)):
        value = surface.evaluate(fabric, below, VIEWS["slanting"])
        assert (value.sum() > 0) == light
        assert surface.evaluate(fabric, below, -VIEWS["slanting"]).sum() > 0


@pytest.mark.parametrize("level", surface.LEVELS)
def test_conserving_cloth_is_reciprocal(level):
    wi, wo = random_directions(300, 5, upper=False), random_directions(300, 6, upper=False)
    for name, preset in PRESETS.items():
        fabric = with_model(preset, "conserving")
        for place in PLACES[:2] if level != "far" else PLACES[:1]:
            forth = surface.evaluate(fabric, wi, wo, uv=place, level=level) / abs(wi[:, 2:])
            back = surface.evaluate(fabric, wo, wi, uv=place, level=level) / abs(wo[:, 2:])
            scale = 1e-12 * max(forth.max(), 1.0)
            assert forth == pytest.approx(back, rel=1e-11, abs=scale), name


@pytest.mark.parametrize("name", PRESETS)
def test_the_published_models_are_not_reciprocal_at_fabric_level(name):
    wi, wo = random_directions(2000, 5), random_directions(2000, 6)
    forth = surface.evaluate(PRESETS[name], wi, wo)[:, 0] / wi[:, 2]
    back = surface.evaluate(PRESETS[name], wo, wi)[:, 0] / wo[:, 2]
    both = np.maximum(forth, back)
    difference = np.abs(forth - back)[both > 0] / both[both > 0]
    assert 0.05 < np.median(difference) < 1.0


def test_a_tenth_of_the_pairs_on_velvet_are_lost_to_a_vanishing_q():
    wi, wo = random_directions(20_000, 7), random_directions(20_000, 8)
    value = surface.evaluate(PRESETS["velvet"], wi, wo)
    assert 0.05 < (value.sum(axis=1) == 0).mean() < 0.15
    q = plain.normalization(PRESETS["velvet"], wi[:300], wo[:300])
    assert ((value[:300].sum(axis=1) == 0) == (q <= plain.NOTHING)).mean() > 0.97


EXTREMES = {
    "mirror lobes": {"gamma_surface": 1e-9, "gamma_volume": 1e-9},
    "lobes wider than the circle": {"gamma_surface": math.pi, "gamma_volume": math.pi},
    "no surface": {"ior": 1.0},
    "total reflection": {"ior": 1e9},
    "black": {"albedo": (0.0, 0.0, 0.0)},
    "white": {"albedo": (1.0, 1.0, 1.0)},
    "no isotropic part": {"isotropic": 0.0},
    "only isotropic": {"isotropic": 1.0},
    "upright": {"curve": TangentCurve(angles=(-math.pi / 2, math.pi / 2))},
    "level, then upright": {
        "curve": TangentCurve(positions=(0, 1, 1, 2), angles=(0, 0, math.pi / 2, math.pi / 2))
    },
}


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("extreme", often(EXTREMES, ("mirror lobes", "white", "upright")))
def test_extreme_threads_give_sound_values_and_densities(extreme, model):
    fabric = with_model(PRESETS["silk_shot"], model)
    fabric = replace(
        fabric, threads={k: replace(t, **EXTREMES[extreme]) for k, t in fabric.threads.items()}
    )
    wi, wo = random_directions(2000, 9, upper=False), random_directions(2000, 10)
    for level in surface.LEVELS:
        value = surface.evaluate(fabric, wi, wo, uv=PLACES[:2000], level=level, multiple=False)
        assert sound(value)
    drawn = surface.sample(fabric, wo, np.random.default_rng(1).random((2000, 3)))
    assert sound(drawn.f)
    assert sound(drawn.pdf)
    assert np.linalg.norm(drawn.wi, axis=1) == pytest.approx(np.ones(2000), abs=1e-9)
    black = extreme == "total reflection" or extreme == "black"
    volume = value[:, 0] if extreme == "no surface" else np.ones(1)
    assert black or volume.max() > 0


def test_without_a_surface_the_value_is_proportional_to_the_albedo():
    threads = {
        k: replace(t, ior=1.0, albedo=(0.2, 0.4, 0.0)) for k, t in PRESETS["velvet"].threads.items()
    }
    value = surface.evaluate(
        replace(PRESETS["velvet"], threads=threads), direction(30, 40), direction(50, 80)
    )[0]
    assert value[1] == pytest.approx(2 * value[0], rel=1e-12)
    assert value[2] == 0
    assert value[0] > 0


@pytest.mark.parametrize("size", [1, 4096])
def test_the_smallest_and_the_largest_grid(size):
    cells = np.ones((1, 1), bool) if size == 1 else np.indices((size, size)).sum(axis=0) % 2 == 0
    fabric = replace(PRESETS["linen_plain"], weave=Weave(cells))
    for level in surface.LEVELS:
        value = surface.evaluate(
            fabric, direction(20, 10), direction(40, 100), uv=(123.5, 7.5), level=level
        )
        assert sound(value)
        assert value.sum() > 0


def test_a_curve_with_pieces_of_no_length_is_the_curve_without_them():
    plain_curve = TangentCurve(positions=(0, 1, 2), angles=(-0.3, 0.1, 0.4))
    padded = TangentCurve(
        positions=(0, 0, 1, 1, 1, 2, 2), angles=(1.2, -0.3, 0.1, -0.9, 0.1, 0.4, -1.0)
    )
    values = []
    for curve in (plain_curve, padded):
        threads = {k: replace(t, curve=curve) for k, t in PRESETS["silk_shot"].threads.items()}
        fabric = replace(PRESETS["silk_shot"], threads=threads)
        values.append(surface.evaluate(fabric, VIEWS["slanting"], VIEWS["normal"]))
    assert values[0] == pytest.approx(values[1], rel=1e-12)


@given(
    st.sampled_from(sorted(PRESETS)), st.sampled_from(PUBLISHED),
    st.floats(0, 89.99999), st.floats(0, 360), st.floats(0, 89.99999), st.floats(0, 360),
)  # fmt: skip
def test_any_pair_of_directions_gives_a_sound_value(name, model, ti, pi, to, po):
    fabric = with_model(PRESETS[name], model)
    assert sound(surface.evaluate(fabric, direction(ti, pi), direction(to, po)))


def test_cloth_that_covers_nothing_reflects_nothing():
    bare = ThreadSet(sequence=(0,), coverage=0.0)
    fabric = Fabric(threads={"Thread": Thread()}, warp=bare, weft=bare)
    for model in PUBLISHED:
        value = surface.evaluate(with_model(fabric, model), VIEWS["normal"], VIEWS["slanting"])
        assert (value == 0).all()
        drawn = surface.sample(with_model(fabric, model), VIEWS["normal"], [[0.5, 0.5, 0.5]])
        assert drawn.pdf == pytest.approx([0.5 / math.pi])


BAD = {
    "wi has 1 of 2 directions that are not finite, the first at 1": {
        "wi": [(0, 0, 1), (math.nan, 0, 1)]
    },
    "wo 0 has length 2; it must be a unit vector": {"wo": [(0, 0, 2)]},
    "wi has shape (1, 2); it must be (n, 3)": {"wi": [(0, 1)]},
    "level is 'near'; it must be one of far, weave, thread": {"level": "near"},
    "shadow is 'soft'; it must be one of none, peak, horizon, traced": {"shadow": "soft"},
    "uv is missing; level weave requires weave coordinates, (n, 2)": {"level": "weave"},
    "wo has 2 directions; it must have 3 or 1": {
        "wi": [(0, 0, 1)] * 3, "level": "weave", "uv": [(0, 0)] * 2, "wo": [(0, 0, 1)] * 2
    },
}  # fmt: skip


@pytest.mark.parametrize("message", BAD)
def test_a_wrong_argument_is_refused_with_its_place_and_what_would_do(message):
    arguments = {"wi": direction(20, 0), "wo": direction(30, 0), **BAD[message]}
    with pytest.raises(FabricError) as refusal:
        surface.evaluate(PRESETS["silk_shot"], **arguments)
    assert str(refusal.value) == message


def test_nan_that_reaches_a_kernel_comes_out_as_nan():
    tables = surface_tables(PRESETS["linen_plain"])
    for spoiled in range(6):
        pair = np.array([*direction(20, 10), *direction(50, 80)])
        pair[spoiled] = math.nan
        wi, wo = pair[:3, None].copy(), pair[3:, None].copy()
        out = np.zeros((3, 1))
        far_values(np.float64, tables, wi, wo, out, 0, 1)
        assert np.isnan(out).all(), spoiled


@pytest.mark.parametrize("numbers", [[[0.1, 0.2]], [[0.1, 0.2, 1.5]], [[0.1, math.nan, 0.2]]])
def test_random_numbers_outside_their_range_are_refused(numbers):
    with pytest.raises(FabricError, match=r"u (has|holds)"):
        surface.sample(PRESETS["silk_shot"], direction(20, 0), numbers)


def test_far_out_weave_coordinates_keep_their_place_in_the_thread():
    fabric = PRESETS["silk_shot"]
    near = surface.evaluate(
        fabric, VIEWS["slanting"], VIEWS["normal"], uv=(0.37, 1.61), level="thread"
    )
    far_out = surface.evaluate(
        fabric, VIEWS["slanting"], VIEWS["normal"], uv=(20000.37, 40001.61), level="thread"
    )
    assert near == pytest.approx(far_out, rel=1e-6)


def test_ninety_degrees_is_the_limit_of_what_comes_before_it():
    fabric = PRESETS["linen_plain"]
    values = [
        surface.evaluate(fabric, direction(90 - x, 180), direction(90 - x, 0)).sum()
        for x in (1e-2, 1e-4, 1e-6)
    ]
    assert np.isfinite(values).all()
    # The floors of cos^2 theta_d and of the cosines' sum hold what would grow without bound.
    assert max(values) < 1e6 * DEGREE
