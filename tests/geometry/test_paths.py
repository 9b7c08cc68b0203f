"""Light between tubes: furnaces, reciprocity, agreement of estimators, errors that are true."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.geometry import albedo, reflectance, tubes
from fabricusd.geometry.paths import Assumptions
from fabricusd.schema import load

WOVEN = ("linen_plain", "polyester_satin_charmeuse", "silk_crepe_de_chine", "silk_shot")


def even(fabric: Fabric, shade: float = 1.0) -> Fabric:
    """Threads of the conserving model without surface and lobe: they return `shade` exactly."""
    threads = {
        name: replace(t, albedo=(shade,) * 3, surface_gain=0.0, isotropic=1.0, model="")
        for name, t in fabric.threads.items()
    }
    return replace(fabric, threads=threads, model="conserving", back=None)


def views(*degrees: float) -> np.ndarray:
    e = np.radians(degrees)
    return np.stack((0.8 * np.sin(e), 0.6 * np.sin(e), np.cos(e)), axis=1)


@pytest.mark.parametrize("name", WOVEN)
def test_white_threads_in_a_white_world_are_white(name: str) -> None:
    shares = albedo(tubes(even(load(name))), views(0, 30, 60, 80), count=1 << 15)
    total, error = shares.total[:, 0], shares.error[:, 0]
    # The weight of a tube's side closes on average only: every view within .02.
    assert (np.abs(total - 1) < 0.02 + 3 * error).all()
    assert abs(total.mean() - 1) < 0.005 + 3 * np.hypot.reduce(error) / len(error)
    assert shares.lost.max() < 0.005
    assert shares.left.max() == 0.0


def test_threads_that_absorb_do_not_close() -> None:
    # That the furnace above can fail.
    shares = albedo(tubes(even(load("linen_plain"), 0.95)), views(30), count=1 << 13)
    assert shares.total[0, 0] < 0.97


def test_black_threads_pass_the_gap_alone() -> None:
    shares = albedo(tubes(even(load("linen_plain"), 0.0)), views(0), count=1 << 14)
    assert shares.gap[0] == pytest.approx(0.34, abs=0.005)
    assert shares.total[0, 0] == pytest.approx(shares.gap[0], abs=1e-12)


def test_tubes_are_reciprocal() -> None:
    fabric = replace(load("linen_plain"), model="conserving")
    cloth = tubes(fabric)
    w = np.concatenate((views(20, 50), views(65) * (-1, 1, 1), views(40) * (1, -1, -1)))
    i, o = np.array([0, 0, 1, 2]), np.array([1, 2, 3, 3])
    there = reflectance(cloth, w[o], w[i], count=1 << 15)
    back = reflectance(cloth, w[i], w[o], count=1 << 15, seed=1)
    # f/cos is the same both ways.
    f, g = there.value / np.abs(w[i, 2:]), back.value / np.abs(w[o, 2:])
    error = np.hypot(there.error / np.abs(w[i, 2:]), back.error / np.abs(w[o, 2:]))
    # The exit's bends and widths are averages: 5 % beside the noise.
    assert (np.abs(f - g) < 0.05 * f + 4 * error).all()


def test_reflectance_integrates_to_albedo() -> None:
    fabric = replace(load("silk_shot"), model="conserving")
    cloth, rng = tubes(fabric), np.random.default_rng(2)
    wo = views(40)
    z, a = rng.random(400), 2 * np.pi * rng.random(400)
    r = np.sqrt(1 - z * z)
    sky = np.stack((r * np.cos(a), r * np.sin(a), z), axis=1)
    f = reflectance(cloth, wo, sky, count=512).value * 2 * np.pi
    error = f.std(axis=0) / np.sqrt(len(sky))
    shares = albedo(cloth, wo, count=1 << 15)
    assert (
        np.abs(f.mean(axis=0) - shares.reflected[0]) < 4 * np.hypot(error, shares.error[0])
    ).all()


def test_stated_errors_are_those_of_repeated_runs() -> None:
    cloth = tubes(load("linen_plain"))
    wo, wi = views(30)[0], views(50)[0]
    runs = [reflectance(cloth, wo, wi, count=2048, seed=k) for k in range(24)]
    spread = np.std([r.value[0] for r in runs], axis=0, ddof=1)
    stated = np.sqrt(np.mean([r.error[0] ** 2 for r in runs], axis=0))
    assert (spread < 1.6 * stated).all()
    assert (spread > 0.6 * stated).all()


def test_published_threads_scatter_once_and_say_what_is_left() -> None:
    shares = albedo(tubes(load("linen_plain")), views(30), count=1 << 13)
    np.testing.assert_array_equal(shares.reflected, shares.reflected_once)
    assert (shares.left > 0).all()


def test_a_sky_that_is_dark_below_lights_from_above_alone() -> None:
    cloth = tubes(even(load("linen_plain")))
    shares = albedo(cloth, views(30), lambda w: (w[:, 2] > 0).astype(float), count=1 << 13)
    assert shares.transmitted[0, 0] == 0
    assert shares.gap[0] == 0
    assert shares.reflected[0, 0] > 0.3


def test_independent_exits_change_figures_and_no_furnace() -> None:
    cloth = tubes(even(load("linen_plain")))
    free = Assumptions(correlated=False)
    assert albedo(cloth, views(30), count=1 << 14, assumptions=free).total[0, 0] == pytest.approx(
        1, abs=0.02
    )


@pytest.mark.parametrize(
    ("wo", "wi", "says"),
    [
        ((0, 0, 2.0), (0, 0, 1.0), "wo 0"),
        ((0, 0, 1.0), (1.0, 0, 0), "wi 0"),
        ((0, 0, np.nan), (0, 0, 1.0), "wo 0"),
        ((0, 1.0), (0, 0, 1.0), "wo has shape"),
    ],
)
def test_bad_directions_are_refused(wo: tuple, wi: tuple, says: str) -> None:
    cloth = tubes(load("linen_plain"))
    with pytest.raises(FabricError, match=says):
        reflectance(cloth, wo, wi, count=64)


def test_the_back_of_a_satin_that_has_one_of_its_own_is_refused() -> None:
    cloth = tubes(load("polyester_satin_charmeuse"))
    with pytest.raises(FabricError, match="looks at the back"):
        reflectance(cloth, (0, 0, -1.0), (0, 0, -1.0), count=64)
