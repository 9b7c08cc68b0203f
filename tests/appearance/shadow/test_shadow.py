"""Four methods of thread-to-thread shadowing, and the march that the others are measured by."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.shadow.height import highest_point
from fabricusd.appearance.shadow.horizon import shape_repeat
from fabricusd.appearance.shadow.kinds import METHODS, Shadow
from fabricusd.appearance.shadow.methods import compile_shadow, lit_all, mean_lit, shadowing
from fabricusd.appearance.weave.bands import seen_length
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.appearance.weave.place import Hit
from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, Fabric, TangentCurve, Thread, ThreadSet, Weave
from tests.appearance.presets import LINEN, PLAIN, PRESETS, often
from tests.strategies import fabrics

WOVEN = {name: fabric for name, fabric in PRESETS.items() if name != "velvet"}


def lights(count: int, seed: int, low: float = 1.0, high: float = 80.0) -> np.ndarray:
    """(count, 3) directions, elevations even from `low` to `high` degrees."""
    rng = np.random.default_rng(seed)
    azimuth = rng.random(count) * 2 * math.pi
    elevation = (low + (high - low) * rng.random(count)) * DEGREE
    flat = np.cos(elevation)
    return np.stack([np.cos(azimuth) * flat, np.sin(azimuth) * flat, np.sin(elevation)], axis=1)


def places(fabric: Fabric, count: int, seed: int) -> np.ndarray:
    """(count, 2) places on threads of the repeat."""
    uv = np.random.default_rng(seed).random((4 * count, 2)) * fabric.weave.cells.shape
    return uv[~lookup(fabric, uv).gap][:count]


def walked(fabric: Fabric, wi: np.ndarray, uv: np.ndarray, steps: int) -> np.ndarray:
    """Whether light arrives, by looking the weave up at `steps` places along each ray."""
    cloth = compile_fabric(fabric, precision=np.float64)
    at = lookup(cloth, uv)
    crown = at.crown
    start = at.height + crown
    top = highest_point(fabric, cloth)
    pitch = cloth.pitch[::-1]
    answer = np.ones(len(uv))
    for k, light in enumerate(wi):
        flat = math.hypot(light[0], light[1])
        slope = light[2] / flat
        t = np.linspace(1e-4 * pitch.min(), max((top - start[k]) / slope, 1e-9), steps)
        way = uv[k] + t[:, None] * light[:2] / flat / pitch
        met = lookup(cloth, way)
        number = np.where(met.set == 1, np.floor(way[:, 0]), np.floor(way[:, 1]))
        own = number == np.floor(uv[k, 0] if at.set[k] == 1 else uv[k, 1])
        own &= met.set == at.set[k]
        height = np.where(met.gap, -1.0, met.height + np.where(own, crown[k], met.crown))
        answer[k] = not (height > start[k] + t * slope + 1e-9).any()
    return answer


@pytest.mark.parametrize("name", often(WOVEN, LINEN))
def test_the_march_finds_what_walking_finely_finds(name: str) -> None:
    fabric = WOVEN[name]
    uv = places(fabric, 400, 1)
    wi = lights(len(uv), 2)
    marched = shadowing(fabric, wi, uv, "traced")
    looked = walked(fabric, wi, uv, 1500)
    # Walking misses what lies between its steps, never the other way round.
    assert not ((marched == 1) & (looked == 0)).any()
    assert np.count_nonzero(marched != looked) <= 1


def test_walking_tells_a_curve_five_percent_steeper() -> None:
    fabric = WOVEN["silk_crepe_de_chine"]
    weft = fabric.threads["Weft"]
    steeper = tuple(1.05 * a for a in weft.curve.angles)
    other = replace(
        fabric,
        threads={
            **fabric.threads,
            "Weft": replace(weft, curve=replace(weft.curve, angles=steeper)),
        },
    )
    uv = places(fabric, 400, 1)
    wi = lights(len(uv), 2)
    changed = shadowing(fabric, wi, uv, "traced") != shadowing(other, wi, uv, "traced")
    assert np.count_nonzero(changed) > 2


@given(fabrics(back=False), st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_every_method_gives_a_share_on_every_fabric(fabric: Fabric, seed: int) -> None:
    rng = np.random.default_rng(seed)
    uv = rng.uniform(-1e4, 1e4, (40, 2))
    wi = rng.normal(size=(40, 3))
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    for method in ("none", "peak", "traced"):
        g = shadowing(fabric, wi, uv, method)
        assert ((g >= 0) & (g <= 1)).all()
        assert not g[wi[:, 2] <= 0].any()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", often(PRESETS, ("linen_plain", "velvet")))
def test_limits_of_every_method(name: str, method: str) -> None:
    fabric = PRESETS[name]
    uv = places(fabric, 300, 3)
    ones = np.ones((len(uv), 1))
    for below in ([0.6, 0.0, -0.8], [1.0, 0.0, 0.0]):
        assert not shadowing(fabric, ones * below, uv, method).any()
    assert (shadowing(fabric, ones * [0.0, 0.0, 1.0], uv, method) == 1).all()
    g = shadowing(fabric, lights(len(uv), 4, 1e-7, 1e-6), uv, method)
    assert ((g >= 0) & (g <= 1)).all()


def test_none_shades_nothing_and_pile_is_never_shaded() -> None:
    linen, velvet = PRESETS["linen_plain"], PRESETS["velvet"]
    wi = lights(300, 5)
    assert (shadowing(linen, wi, places(linen, 300, 6), "none") == 1).all()
    for method in METHODS:
        assert (shadowing(velvet, wi, places(velvet, 300, 6), method) == 1).all()


@pytest.mark.parametrize("method", METHODS)
def test_shadows_repeat_with_the_weave_and_cross_its_border(method: str) -> None:
    fabric = WOVEN["polyester_satin_charmeuse"]
    uv = places(fabric, 400, 7)
    wi = lights(len(uv), 8)
    here = shadowing(fabric, wi, uv, method)
    far_off = shadowing(fabric, wi, uv + np.array([5e4, -5e4]), method)
    np.testing.assert_allclose(far_off, here, atol=2e-3)
    # The same cloth with the border of its repeat somewhere else.
    cells = np.roll(fabric.weave.cells, (2, 3), axis=(0, 1))
    moved = shadowing(replace(fabric, weave=Weave(cells)), wi, uv + np.array([2, 3]), method)
    np.testing.assert_allclose(moved, here, atol=1e-9)


def across(fabric: Fabric, wi: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """(n,) light that reaches each place, marched, and averaged across its thread."""
    cloth = compile_fabric(fabric, precision=np.float64)
    hit, total = lookup(cloth, uv), np.zeros(len(uv))
    offset = (np.arange(12) + 0.5) / 12 - 0.5
    for x in offset:
        moved = uv.copy()
        for which, axis in ((WARP, 0), (WEFT, 1)):
            mine = hit.set == which
            moved[mine, axis] = np.floor(uv[mine, axis]) + 0.5 + x * cloth.width[which]
        total += shadowing(fabric, wi, moved, "traced")
    return total / len(offset)


@pytest.mark.parametrize("name", often(WOVEN, LINEN))
def test_a_finer_horizon_table_comes_nearer_to_the_march(name: str) -> None:
    fabric = WOVEN[name]
    cloth = compile_fabric(fabric, precision=np.float64)
    uv = places(fabric, 2000, 9)
    wi = lights(len(uv), 10, 2, 70)
    true = across(fabric, wi, uv)
    error = []
    for azimuths, texels in ((16, 4), (16, 8), (64, 32)):
        shadow = compile_shadow(
            fabric, azimuths=azimuths, texels=texels, softness=2 * DEGREE, precision=np.float64
        )
        g = shadowing(fabric, wi, uv, compiled=(cloth, shadow))
        error.append(math.sqrt(((g - true) ** 2).mean()))
    unshaded = math.sqrt(((1 - true) ** 2).mean())
    assert error[0] > error[2]
    assert error[1] > error[2]
    assert error[1] < 0.55 * unshaded
    # The back of the satin has threads that pass through one another, and walls where they do.
    assert error[2] < (0.45 if name == "polyester_satin_charmeuse_back" else 0.3) * unshaded


@pytest.mark.parametrize("method", ["peak", "horizon"])
def test_edges_are_soft_and_light_only_rises_with_its_elevation(method: str) -> None:
    fabric = WOVEN["silk_crepe_de_chine"]
    uv = places(fabric, 60, 11)
    cloth = compile_fabric(fabric, precision=np.float64)
    shadow = compile_shadow(fabric, method, softness=4 * DEGREE, precision=np.float64)
    elevation = np.linspace(0.5, 89, 600) * DEGREE
    for place in uv:
        wi = np.stack([np.cos(elevation), 0 * elevation, np.sin(elevation)], axis=1)
        g = shadowing(fabric, wi, np.tile(place, (600, 1)), compiled=(cloth, shadow))
        assert (np.diff(g) >= -1e-12).all()
        assert np.diff(g).max() < 1.6 * (elevation[1] - elevation[0]) / (4 * DEGREE)


def test_peak_is_the_nearest_of_the_highest_points_in_every_direction() -> None:
    # Plain weave of 1 mm; warp threads hump, the weft is straight: crests at every warp cell's
    # middle, a segment across its width.
    angle = 30 * DEGREE
    fabric = Fabric(
        threads={
            "Warp": Thread(curve=TangentCurve(angles=(-angle, angle)), thickness=0.2e-3),
            "Weft": Thread(thickness=0.2e-3),
        },
        weave=PLAIN,
        warp=ThreadSet(sequence=(0,), density=1000.0, coverage=0.4),
        weft=ThreadSet(sequence=(1,), density=1000.0, coverage=0.5),
    )
    width = coverage(fabric).width
    rise = -math.log(math.cos(angle)) / (2 * angle) * seen_length(1, float(width[WEFT])) * 1e-3
    cloth = compile_fabric(fabric, precision=np.float64)
    shadow = compile_shadow(fabric, "peak", softness=1e-4, precision=np.float64)
    uv = places(fabric, 200, 12)
    hit = lookup(cloth, uv)
    for k, (u, v) in enumerate(uv):
        nearest = min(
            math.hypot(max(0.0, abs(u - i - 0.5) - width[WARP] / 2), v - j - 0.5) * 1e-3
            for i in range(-4, 7)
            for j in range(-4, 7)
            if PLAIN.cells[i % 2, j % 2]
        )
        horizon = math.atan2(rise - hit.height[k], nearest)
        for azimuth in (0.0, 1.0, 4.0):
            elevation = horizon + np.array([-1e-3, 1e-3])
            flat = np.cos(elevation)
            wi = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], 1)
            g = shadowing(fabric, wi, [[u, v]] * 2, compiled=(cloth, shadow))
            np.testing.assert_allclose(g, [0, elevation[1] < math.pi / 2], atol=1e-6)


def test_a_valley_is_lit_from_where_its_wall_ends() -> None:
    # A straight weft beside a warp hump, round across: the horizon along U is its steepest place.
    angle = 40 * DEGREE
    fabric = Fabric(
        threads={
            "Warp": Thread(curve=TangentCurve(angles=(-angle, angle)), thickness=0.1e-3),
            "Weft": Thread(thickness=0.1e-3),
        },
        weave=PLAIN,
        warp=ThreadSet(sequence=(0,), density=1000.0, coverage=0.5),
        weft=ThreadSet(sequence=(1,), density=1000.0, coverage=0.5),
    )
    rise = -math.log(math.cos(angle)) / (2 * angle) * 1e-3
    cloth = compile_fabric(fabric, precision=np.float64)
    half, w = cloth.half_height, np.linspace(-1, 1, 200001)
    wall = rise + half[WARP, 0] * np.sqrt(1 - w * w) - cloth.lift[WEFT] - half[WEFT, 1]
    for distance in (0.1, 0.4, 0.8):
        horizon = math.atan((wall / ((distance + 0.5 * (1 - w)) * 1e-3)).max())
        for elevation in (horizon - 1e-4, horizon + 1e-4):
            wi = [[-math.cos(elevation), 0.0, math.sin(elevation)]]
            g = shadowing(fabric, wi, [[1.0 + distance, 0.5]], "traced")
            assert g[0] == float(elevation > horizon)


def test_a_round_thread_does_not_shade_itself() -> None:
    # Straight threads side by side, so thin that none reaches another: f_s has the dark side.
    fabric = Fabric(
        threads={"T": Thread(thickness=1e-6)},
        weave=Weave(np.array([[True]])),
        warp=ThreadSet(density=1000.0, coverage=0.9),
        weft=ThreadSet(density=1000.0, coverage=0.0),
    )
    wi = lights(500, 13, 10, 80)
    uv = places(fabric, 500, 14)
    assert (shadowing(fabric, wi, uv, "traced") == 1).all()


def test_colours_alone_do_not_lengthen_the_table() -> None:
    linen = PRESETS["linen_plain"].thread_list[0]
    threads = {f"T{k}": replace(linen, albedo=(0.1 * k, 0.0, 0.0)) for k in range(3)}
    fabric = Fabric(
        threads={**threads, "thick": replace(linen, thickness=1e-3)},
        weave=PLAIN,
        warp=ThreadSet(sequence=(0, 1, 2, 2, 1, 0, 1)),
        weft=ThreadSet(sequence=(0, 3, 0, 0, 3, 1)),
    )
    assert shape_repeat(fabric) == (2, 6)


@pytest.fixture(scope="module")
def linen() -> tuple[CompiledFabric, Shadow]:
    fabric = PRESETS["linen_plain"]
    return compile_fabric(fabric), compile_shadow(fabric)


def test_what_is_not_a_number_is_counted_or_stays(linen: tuple[CompiledFabric, Shadow]) -> None:
    fabric = PRESETS["linen_plain"]
    with pytest.raises(FabricError, match=r"wi has 1 of 2 rows .* first at 1"):
        shadowing(fabric, [[0, 0, 1], [0, math.nan, 1]], [[0, 0], [0, 0]])
    with pytest.raises(FabricError, match=r"uv_threads has 2 of 2 rows"):
        shadowing(fabric, [[0, 0, 1], [0, 0, 1]], [[math.inf, 0], [0, math.nan]])
    cloth, shadow = linen
    uv, wi = np.full((3, 2), 0.5), np.full((3, 3), 0.5, np.float32)
    uv[0, 0] = wi[0, 1] = wi[2, 2] = math.nan
    g = np.zeros(3, np.float32)
    lit_all(np.float32, cloth, shadow, False, uv, wi, g)
    assert np.isnan(g).all()


BAD = {
    "method": ({"method": "soft"}, "must be one of none, peak, horizon, traced"),
    "softness": ({"softness": 0.0}, "must be above 0"),
    "azimuths": ({"azimuths": 8}, "multiple of 4, at least 16"),
    "texels": ({"texels": 1}, "even number of at least 2"),
}


@pytest.mark.parametrize(("given_", "expected"), BAD.values(), ids=BAD.keys())
def test_what_cannot_be_used_is_refused_in_words(given_: dict, expected: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(FabricError, match=expected):
        compile_shadow(PRESETS["linen_plain"], **given_)


def test_shapes_that_do_not_match_are_refused() -> None:
    with pytest.raises(FabricError, match=r"they must be \(n, 3\), \(n, 2\)"):
        shadowing(PRESETS["linen_plain"], [[0, 0, 1]], [[0, 0], [1, 1]])


def test_float32_agrees_with_float64_away_from_the_edges() -> None:
    fabric = WOVEN["polyester_satin_charmeuse"]
    uv = places(fabric, 4000, 17) + 1e4
    wi = lights(len(uv), 18)
    for method in ("peak", "horizon", "traced"):
        g = {}
        for real in (np.float32, np.float64):
            cloth = compile_fabric(fabric, precision=real)
            shadow = compile_shadow(fabric, method, precision=real)
            g[real] = shadowing(fabric, wi, uv, compiled=(cloth, shadow))
        error = np.abs(g[np.float32] - g[np.float64])
        assert np.quantile(error, 0.995) < 1e-3, method


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", often(WOVEN))
def test_the_mean_of_light_is_that_over_the_places_of_a_stretch(name: str, method: str) -> None:
    fabric = WOVEN[name]
    cloth = compile_fabric(fabric, precision=np.float64)
    shadow = compile_shadow(fabric, method, precision=np.float64)
    uv = places(fabric, 6000, 19)
    hit = lookup(fabric, uv)
    real = np.float64
    for wi in lights(6, 20, 8.0, 60.0):
        towards = np.tile(wi, (len(uv), 1))
        g = shadowing(fabric, towards, uv, compiled=(cloth, shadow))
        mean = np.array(
            [
                mean_lit(real, cloth, shadow, Hit(*place, 0.0), *wi) if method != "none" else 1.0
                for place in zip(hit.set, hit.thread, hit.position, hit.across, strict=True)
            ]
        )
        assert ((mean >= 0) & (mean <= 1)).all()
        for which in (WEFT, WARP):
            mine = hit.set == which
            if np.count_nonzero(mine) > 300:
                # The march is too slow for more than a few places of each stretch.
                most = 0.06 if method == "traced" else 0.04
                assert mean[mine].mean() == pytest.approx(g[mine].mean(), abs=most)


def test_nothing_shades_pile_in_the_mean() -> None:
    velvet = PRESETS["velvet"]
    shadow = compile_shadow(velvet, "traced", precision=np.float64)
    assert not shadow.mean.any()
