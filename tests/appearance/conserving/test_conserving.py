"""Cloth of `conserving` threads: reciprocity, passivity, both sides, the independent version."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numba import njit, prange

from fabricusd.appearance import plain
from fabricusd.appearance.conserving import facets, levels, multiple
from fabricusd.appearance.conserving import single as conserving
from fabricusd.appearance.conserving.by_side import by_side
from fabricusd.appearance.conserving.grid import without_border
from fabricusd.appearance.conserving.shares import conserving_mixture
from fabricusd.appearance.sampling.mixture import density, direction
from fabricusd.appearance.weave.place import Place
from fabricusd.appearance.weave.quadrature import POINTS, Rule
from fabricusd.errors import FabricError
from fabricusd.fabric import TangentCurve
from fabricusd.kernels.real import KERNEL
from fabricusd.sides import Sides
from tests.appearance.presets import PRESETS, often, with_model

CLOTHS = {name: with_model(fabric, "conserving") for name, fabric in PRESETS.items()}
WHITE = {name: plain.white(fabric) for name, fabric in CLOTHS.items()}
WOVEN = [name for name in CLOTHS if name != "velvet"]
TABLES = {}


def _tables(name, multiple_too=True):
    """Of the white cloth, made once a session: the scattering table takes a second."""
    key = name, multiple_too
    if key not in TABLES:
        TABLES[key] = multiple.conserving_tables(WHITE[name], multiple=multiple_too)
    return TABLES[key]


def _directions(seed, n, precision=np.float64):
    w = np.random.default_rng(seed).standard_normal((n, 3)).astype(precision)
    return w / np.sqrt((w * w).sum(axis=1))[:, None]


@njit(**KERNEL, parallel=True)
def _values(R, tables, wi, wo, out):
    for k in prange(len(wi)):
        a, b, c = multiple.conserving_value(
            R, tables, wi[k, 0], wi[k, 1], wi[k, 2], wo[k, 0], wo[k, 1], wo[k, 2]
        )
        out[k, 0], out[k, 1], out[k, 2] = a, b, c


def _value(tables, wi, wo):
    out = np.empty_like(wi)
    _values(wi.dtype.type, tables, wi, np.ascontiguousarray(np.broadcast_to(wo, wi.shape)), out)
    return out


@njit(**KERNEL, parallel=True)
def _draw(R, tables, sampling, wo, n, wi, pdf):
    """The R2 sequence, the first number in order: lobes are strata of it."""
    for k in prange(n):
        x, y, z = direction(
            R, sampling, wo[0], wo[1], wo[2], R((k + 0.5) / n),
            R((0.5 + k * 0.7548776662466927) % 1.0), R((0.5 + k * 0.5698402909980532) % 1.0),
        )  # fmt: skip
        wi[k, 0], wi[k, 1], wi[k, 2] = x, y, z
        pdf[k] = density(R, sampling, x, y, z, wo[0], wo[1], wo[2])


def _given_back(tables, sampling, wo, n):
    """(reflected, transmitted): what the first channel gives back of the light from wo."""
    wi, pdf = np.empty((n, 3)), np.empty(n)
    _draw(np.float64, tables, sampling, wo, n, wi, pdf)
    drawn = pdf > 0
    share = _value(tables, wi, wo)[:, 0] / np.where(drawn, pdf, 1.0) * drawn
    same = (wi[:, 2] > 0) == (wo[2] > 0)
    return share[same].sum() / n, share[~same].sum() / n


def _gap(tables, w):
    return levels.gap_towards(np.float64, tables, *w)


def _view(degrees, azimuth):
    theta, phi = math.radians(degrees), math.radians(azimuth)
    s = math.sin(theta)
    return np.array([s * math.cos(phi), s * math.sin(phi), math.cos(theta)])


@pytest.mark.parametrize("name", often(CLOTHS))
def test_single_scattering_agrees_with_the_plain_version(name):
    wi, wo = _directions(1, 400), _directions(2, 400)
    rule = Rule(POINTS, 0.1)
    fabric = replace(CLOTHS[name], opaque=False)
    tables = multiple.conserving_tables(fabric, multiple=False, rule=rule)
    got = _value(tables, wi, wo)
    want = plain.conserving_far(
        CLOTHS[name], wi, wo, sides=None if tables.sides.size == 0 else without_border(tables.sides)
    )
    # The two integrate the curves differently; q = 1/cos makes pile converge slowly.
    bound = 1e-2 if name == "velvet" else 1e-3
    assert np.abs(got - want).mean() < bound * want.mean()


@pytest.mark.parametrize("multiple_too", [False, True], ids=["single", "multiple"])
@pytest.mark.parametrize("name", often(CLOTHS))
def test_cloth_is_reciprocal(name, multiple_too):
    tables = _tables(name, multiple_too)
    wi, wo = _directions(3, 3000), _directions(4, 3000)
    forward = _value(tables, wi, wo) / np.abs(wi[:, 2:])
    back = _value(tables, wo, wi) / np.abs(wo[:, 2:])
    np.testing.assert_allclose(forward, back, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", often(CLOTHS))
def test_single_scattering_is_passive_to_the_horizon(name):
    tables = _tables(name, False)
    sampling = conserving_mixture(WHITE[name], tables)
    for degrees in (0, 45, 75, 89, 89.9):
        view = _view(degrees, 30)
        given_back = sum(_given_back(tables, sampling, view, 4096))
        assert 0 < given_back <= 1 - _gap(tables, view) + 1e-4, degrees


@pytest.mark.parametrize("name", often(CLOTHS))
def test_white_cloth_gives_everything_back(name):
    # MODEL section 7: reflected + transmitted + gap = 1.
    tables = _tables(name)
    sampling = conserving_mixture(WHITE[name], tables)
    views = [_view(d, a) for d in (0, 30, 60, 75, 85) for a in (5, 130)]
    found = [sum(_given_back(tables, sampling, v, 1 << 14)) + _gap(tables, v) - 1 for v in views]
    if name in WOVEN:
        assert np.max(np.abs(found)) < 0.005
    else:
        assert np.max(np.abs(found)) < 0.01
        assert np.sqrt(np.mean(np.square(found))) < 0.002


@pytest.mark.parametrize("name", ["linen_plain", "polyester_satin_charmeuse"])
def test_cloth_that_loses_its_multiple_scattering_does_not(name):
    # The twin of the test above, with a strength that is 5 % wrong.
    tables = _tables(name)
    wrong = tables._replace(strength=0.95 * tables.strength)
    sampling = conserving_mixture(WHITE[name], wrong)
    given_back = sum(_given_back(wrong, sampling, _view(30, 50), 1 << 14))
    assert given_back + _gap(tables, _view(30, 50)) < 1 - 0.005


def test_a_grazing_view_of_white_cloth_gains_nothing_either():
    for name in WOVEN:
        tables = _tables(name)
        sampling = conserving_mixture(WHITE[name], tables)
        for degrees in (88, 89.9):
            view = _view(degrees, 50)
            total = sum(_given_back(tables, sampling, view, 1 << 14))
            assert abs(total + _gap(tables, view) - 1) < 0.005, (name, degrees)


@pytest.mark.parametrize("multiple_too", [False, True], ids=["single", "multiple"])
@pytest.mark.parametrize("name", ["linen_plain", "polyester_satin_charmeuse"])
def test_cloth_sends_to_each_side_what_its_fabric_states(name, multiple_too):
    tables = _tables(name, multiple_too)
    sampling = conserving_mixture(WHITE[name], tables)
    views = [_view(d, a) for d in (0, 35, 60, 80, 85) for a in (10, 65)]
    theta, phi = np.arccos(np.array(views)[:, 2]), np.arctan2(*np.array(views).T[[1, 0]])
    stated = by_side(WHITE[name], theta, phi)
    met = 1.0 - stated.gap
    surface = met * facets.surface_shares(WHITE[name], np.array(views))
    reflected = surface * stated.surface + (met - surface) * stated.reflected
    transmitted = (met - surface) * stated.transmitted
    if multiple_too:
        rest = met - reflected - transmitted
        reflected = reflected + (1.0 - stated.forward) * rest
        transmitted = transmitted + stated.forward * rest
    found = np.array([_given_back(tables, sampling, v, 1 << 14) for v in views])
    np.testing.assert_allclose(found.T, (reflected, transmitted), atol=0.005)


def test_a_fabric_may_state_where_its_light_goes():
    # Everything that meets a thread goes through; at 60 degrees half of the light meets none.
    stated = Sides(gap=(0.5,), surface=(0.0,), reflected=(0.0,), transmitted=(0.6,), forward=(1.0,))
    fabric = replace(WHITE["linen_plain"], sides=stated)
    tables = multiple.conserving_tables(fabric)
    view = _view(60, 20)
    r, t = _given_back(tables, conserving_mixture(fabric, tables), view, 1 << 14)
    assert (r, t) == (pytest.approx(0, abs=1e-3), pytest.approx(0.5, abs=0.005))
    assert _gap(tables, view) == pytest.approx(0.5)


def test_a_factor_scales_both_ends_of_every_path():
    rng = np.random.default_rng(16)
    matrix = rng.random((30, 30))
    matrix += matrix.T
    share = rng.uniform(0.1, 0.6, 30)
    factor, found = multiple.fitted_factor(matrix / 60, share)
    np.testing.assert_allclose(factor * (matrix / 60 @ factor), share, atol=2 * multiple.SETTLED)
    np.testing.assert_allclose(found, share, atol=2 * multiple.SETTLED)
    # Where nothing is sent there is nothing to scale.
    factor, found = multiple.fitted_factor(np.zeros((3, 3)), np.full(3, 0.2))
    assert (factor == 1).all()
    assert (found == 0).all()


def test_opaque_cloth_lets_nothing_through():
    tables = _tables("velvet")
    above, below = np.array([[0.0, 0.6, 0.8]]), np.array([[0.6, 0.0, -0.8]])
    assert np.all(_value(tables, above, below) == 0)
    assert np.all(_value(tables, below, above) == 0)
    assert np.all(_value(tables, below, below) > 0)


@pytest.mark.parametrize("name", often(WOVEN))
def test_thin_cloth_passes_light_both_ways_alike(name):
    tables = _tables(name)
    up, down = _view(30, 40)[None], -_view(50, 80)[None]
    through = _value(tables, up, down)
    assert np.all(through > 0)
    # Half a turn about an axis in the cloth: -w for w, which the law does not change under.
    np.testing.assert_allclose(_value(tables, -up, -down), through, rtol=1e-12)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("name", often(CLOTHS))
def test_no_pair_of_directions_holds_a_bad_value(name, precision):
    tables = multiple.conserving_tables(CLOTHS[name], precision=precision, multiple=False)
    sides = _tables(name).sides.astype(precision)
    tables = tables._replace(sides=sides, strength=np.ones((2, 3), precision))
    wi, wo = _directions(5, 100_000, precision), _directions(6, 100_000, precision)
    wi[:1000], wo[500:1500] = wo[:1000], -wi[500:1500]
    special = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1e-30], [0, -1, -1e-30],
                        [0, 0, -1], [0.6, 0, 0.8], [0, 0.6, 0.8]], precision)  # fmt: skip
    a, b = (special[k.ravel()] for k in np.meshgrid(np.arange(8), np.arange(8)))
    wi, wo = np.concatenate((wi, a)), np.concatenate((wo, b))
    value = _value(tables, wi, wo)
    assert np.all(np.isfinite(value))
    assert np.all(value >= 0)


@pytest.mark.parametrize("name", often(CLOTHS))
def test_float32_agrees_with_float64(name):
    single = multiple.conserving_tables(CLOTHS[name], precision=np.float32, multiple=False)
    double = multiple.conserving_tables(CLOTHS[name], multiple=False)
    wi, wo = _directions(7, 20_000, np.float32), _directions(8, 20_000, np.float32)
    a, b = _value(single, wi, wo), _value(double, wi.astype(float), wo.astype(float))
    assert np.quantile(np.abs(a - b)[b > 0] / b[b > 0], 0.999) < 1e-4


@pytest.mark.parametrize("name", ["linen_plain", "polyester_satin_charmeuse", "velvet"])
def test_the_mean_over_the_bits_of_thread_is_the_repeat(name):
    tables = _tables(name)
    wi, wo = _view(40, 20), _view(65, 110)
    total = np.zeros(3)
    for k, (c, s, weight) in enumerate(tables.nodes):
        area = weight * max(c, math.cos(math.radians(85)))
        place = Place(int(k >= tables.warp_start), tables.node_thread[k], math.atan2(s, c), 0.0)
        value = multiple.conserving_point_value(np.float64, tables, place, *wi, *wo)
        total += area * np.array(value)
    np.testing.assert_allclose(total, _value(tables, wi[None], wo[None])[0], rtol=1e-10)


def test_the_term_is_off_unless_asked_for():
    alone = multiple.conserving_tables(CLOTHS["linen_plain"], multiple=False)
    assert (alone.sides[..., conserving.LOST] == 0).all()
    assert (alone.strength == 0).all()
    published = multiple.conserving_tables(PRESETS["linen_plain"])
    assert published.sides.size == 0
    assert np.all(_value(published, _directions(9, 10), _directions(10, 10)) == 0)


def test_black_threads_send_back_only_their_surface():
    black = multiple.conserving_tables(plain.white(CLOTHS["linen_plain"], 0.0))
    white = _tables("linen_plain")
    assert np.all(black.strength < 0.02 * white.strength)


def test_a_thread_upright_everywhere_stays_finite():
    # n_t.N = 0: without the clamp at 85 degrees q diverges.
    upright = TangentCurve(angles=(math.pi / 2, math.pi / 2))
    fabric = replace(CLOTHS["velvet"], threads={
        k: replace(t, curve=upright) for k, t in CLOTHS["velvet"].threads.items()
    })  # fmt: skip
    tables = multiple.conserving_tables(fabric, multiple=False)
    value = _value(tables, _directions(11, 2000), _directions(12, 2000))
    assert np.all(np.isfinite(value))
    assert value.max() > 0


def test_very_narrow_lobes_do_not_ask_for_endless_nodes():
    fabric = replace(CLOTHS["linen_plain"], threads={
        k: replace(t, gamma_surface=1e-5) for k, t in CLOTHS["linen_plain"].threads.items()
    })  # fmt: skip
    assert len(conserving.single_tables(fabric).nodes) <= conserving.MOST_NODES


def test_alpha_is_one_for_white_threads_and_the_surface_alone_for_black_ones():
    fabric = replace(WHITE["linen_plain"])
    np.testing.assert_allclose(multiple.mean_albedo(fabric), 1.0, rtol=1e-12)
    black = multiple.mean_albedo(plain.white(fabric, 0.0))
    assert np.all((black > 0.05) & (black < 0.3))


def test_cloth_without_threads_scatters_nothing():
    fabric = CLOTHS["linen_plain"]
    bare = replace(fabric, warp=replace(fabric.warp, coverage=0.0),
                   weft=replace(fabric.weft, coverage=0.0))  # fmt: skip
    tables = multiple.conserving_tables(bare)
    assert np.all(_value(tables, _directions(15, 100), _directions(16, 100)) == 0)
    assert np.all(multiple.mean_albedo(bare) == 0)


def test_another_precision_is_refused():
    with pytest.raises(FabricError, match="precision"):
        conserving.single_tables(CLOTHS["linen_plain"], precision=np.float16)


def test_a_mixed_cloth_scatters_by_its_conserving_threads_only():
    fabric = PRESETS["linen_plain"]
    threads = {"Warp": replace(fabric.threads["Warp"], model="conserving"),
               "Weft": replace(fabric.threads["Weft"], model="thesis")}  # fmt: skip
    mixed = conserving.single_tables(replace(fabric, threads=threads))
    whole = conserving.single_tables(CLOTHS["linen_plain"])
    wi, wo = _directions(13, 500), _directions(14, 500)
    part, full = _value(mixed, wi, wo), _value(whole, wi, wo)
    assert np.all(part <= full * (1 + 1e-12))
    assert 0.2 < part.sum() / full.sum() < 0.8
