"""Levels weave and thread: what is under the point, and the means that tie the levels together."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance import plain, surface
from fabricusd.appearance.conserving.single import NODE_COS as C_COS
from fabricusd.appearance.conserving.single import NODE_SIN as C_SIN
from fabricusd.appearance.conserving.single import NODE_WEIGHT as C_WEIGHT
from fabricusd.appearance.law import MIXED, law_value, surface_law
from fabricusd.appearance.levels import FAR, THREAD, WEAVE
from fabricusd.appearance.published.far import far_value, normalization
from fabricusd.appearance.published.levels import point_value, point_values
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering import models
from fabricusd.appearance.scattering.model import PUBLISHED as LAW
from fabricusd.appearance.shadow.kinds import METHODS
from fabricusd.appearance.shadow.mean import LEAST_LIGHT
from fabricusd.appearance.shadow.methods import compile_shadow, mean_lit, shadowing
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.coverage import GAP, WARP, WEFT
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.appearance.weave.place import NOWHERE, Hit, Place, Places
from fabricusd.appearance.weave.quadrature import POINTS, Rule, curve_nodes
from fabricusd.fabric import MODELS
from tests.appearance.directions import VIEWS, direction, random_directions
from tests.appearance.presets import EVERY_RUN, PRESETS, often, with_model

R = np.float64
PUBLISHED = models.names(LAW)
CASES = [(n, m) for n in PRESETS for m in PUBLISHED]
WI, WO = random_directions(12, 1), random_directions(12, 2)


def spread_places(n):
    """(n, 2) weave coordinates, evenly over 30 by 30 cells: a whole number of every repeat."""
    k = np.arange(1, n + 1)
    return np.stack((k * 0.7548776662466927 % 1, k * 0.5698402909980532 % 1), axis=1) * 30


def set_of(nodes, k):
    return WARP if k >= nodes.warp_start else WEFT


@pytest.mark.parametrize(("name", "model"), often(CASES))
def test_the_mean_of_weave_over_shared_nodes_is_far(name, model):
    fabric = with_model(PRESETS[name], model)
    tables, nodes = surface_tables(fabric), curve_nodes(fabric)
    for wi, wo in zip(WI, WO, strict=True):
        mean = np.zeros(3)
        for k, weight in enumerate(nodes.weight):
            place = Place(set_of(nodes, k), nodes.thread[k], nodes.psi0[k], 0.0)
            value = point_value(R, tables, False, place, *wi, *wo)
            mean += weight * np.array(value)
        assert mean == pytest.approx(far_value(R, tables, *wi, *wo), rel=1e-10, abs=1e-13)


@pytest.mark.parametrize("name", often(PRESETS))
def test_the_mean_of_conserving_weave_over_shared_nodes_is_far(name):
    fabric = with_model(PRESETS[name], "conserving")
    law = surface_law(fabric, precision=np.float64)
    tables = law.conserving
    cloth_to_area = np.maximum(tables.nodes[:, C_COS], math.cos(math.radians(85)))
    area = tables.nodes[:, C_WEIGHT] * cloth_to_area
    psi0 = np.arctan2(tables.nodes[:, C_SIN], tables.nodes[:, C_COS])
    for wi, wo in zip(random_directions(12, 3, upper=False), WO, strict=True):
        mean = np.zeros(3)
        for k in range(len(area)):
            place = Place(set_of(tables, k), tables.node_thread[k], psi0[k], 0.0)
            mean += area[k] * np.array(law_value(R, law, WEAVE, place, *wi, *wo))
        in_gap = np.array(law_value(R, law, WEAVE, Place(GAP, 0, 0.0, 0.0), *wi, *wo))
        mean += (1.0 - tables.covered) * in_gap
        whole = law_value(R, law, FAR, NOWHERE, *wi, *wo)
        assert mean == pytest.approx(whole, rel=1e-10, abs=1e-13)


def cases():
    """Of `often`, with `conserving` the linen alone: the others take long."""
    for name in PRESETS:
        for model in MODELS:
            long = name not in EVERY_RUN or (model == "conserving" and name != "linen_plain")
            yield pytest.param(name, model, marks=[pytest.mark.exhaustive] if long else [])


@pytest.mark.parametrize(("name", "model"), list(cases()))
def test_the_mean_of_weave_over_places_is_far(name, model):
    """With the same `Q` or `G1` on both sides; the default rule's own is 0.2 % off on velvet."""
    fabric = with_model(PRESETS[name], model)
    # Narrow lobes and steep pile: few places carry much of the value.
    few = name in ("velvet", "polyester_satin_charmeuse")
    places = spread_places(300_000 if few else 60_000)
    hit = lookup(fabric, places)
    law = surface_law(fabric, precision=np.float64, rule=Rule(POINTS, 0.03), multiple=False)
    over_places, far = np.zeros(3), np.zeros(3)
    for wi, wo in zip(WI[:4], WO[:4], strict=True):
        i, o = (np.repeat(w[:, None], len(places), axis=1) for w in (wi, wo))
        over_places += surface._evaluate(law, "weave", hit, i, o).mean(axis=1)
        far += law_value(R, law, FAR, NOWHERE, *wi, *wo)
    assert over_places == pytest.approx(far, rel=1e-3)


@pytest.mark.parametrize(("name", "model"), often((n, m) for n in PRESETS for m in MODELS))
def test_the_mean_of_thread_over_the_width_is_weave(name, model):
    fabric = with_model(PRESETS[name], model)
    law = surface_law(fabric, precision=np.float64)
    x, weight = np.polynomial.legendre.leggauss(96)
    for thread_set, psi0 in ((WARP, 0.3), (WEFT, -0.4), (WARP, 0.0)):
        thread = int(thread_set == WEFT)
        for wi, wo in zip(WI[:6], WO[:6], strict=True):
            place = Place(thread_set, thread, psi0, 0.0)
            mean = sum(
                0.5 * q * np.array(law_value(R, law, THREAD, place._replace(w=w), *wi, *wo))
                for w, q in zip(x, weight, strict=True)
            )
            whole = law_value(R, law, WEAVE, place, *wi, *wo)
            assert mean == pytest.approx(whole, rel=1e-10, abs=1e-13)


@pytest.mark.parametrize(("name", "model"), often(CASES))
def test_weave_and_thread_are_the_written_model_at_a_point(name, model):
    fabric = with_model(PRESETS[name], model)
    tables = surface_tables(fabric)
    q = np.array([normalization(R, tables, *WI[k], *WO[k]) for k in range(len(WI))])
    for share in plain.shares(fabric):
        thread = fabric.thread_list.index(share.thread)
        for psi0, w in ((0.35, -0.7), (-0.1, 0.95), (0.0, 0.0)):
            width = np.full(len(WI), w)
            written = plain.segment(fabric, share, psi0, WI, WO, width)
            place = Place(int(share.is_warp), thread, psi0, w)
            found = [point_value(R, tables, True, place, *WI[k], *WO[k]) for k in range(len(WI))]
            found = np.array(found) * q[:, None]
            assert found == pytest.approx(written * (q > 1e-12)[:, None], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("across_too", [False, True])
@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_the_scalar_and_the_vectorised_kernel_agree(across_too, precision):
    uv = spread_places(700)
    wi, wo = random_directions(700, 8), random_directions(700, 9)
    for name, fabric in PRESETS.items():
        tables, hit = surface_tables(fabric, precision=precision), lookup(fabric, uv)
        i, o = (np.ascontiguousarray(w.T, precision) for w in (wi, wo))
        psi0, w = hit.angle.astype(precision), hit.across.astype(precision)
        out = np.empty_like(i)
        places = Places(hit.set, hit.thread, psi0, w)
        point_values(precision, tables, across_too, places, i, o, out, 0, 700)
        for k in range(0, 700, 9):
            expected = (0.0, 0.0, 0.0)
            if hit.set[k] != GAP:
                place = Place(int(hit.set[k]), int(hit.thread[k]), psi0[k], w[k])
                expected = point_value(precision, tables, across_too, place, *i[:, k], *o[:, k])
            tolerance = 1e-12 if precision is np.float64 else 1e-4
            assert out[:, k] == pytest.approx(expected, rel=tolerance, abs=1e-7), name


@pytest.mark.parametrize("level", ["weave", "thread"])
@pytest.mark.parametrize("model", MODELS)
def test_a_gap_reflects_nothing_and_a_thread_does(level, model):
    fabric = with_model(PRESETS["linen_plain"], model)
    # Seen from above: the gap of `conserving` cloth closes as the view turns away.
    wi, wo = direction(20, 10), direction(0, 0)
    gap, thread = surface.evaluate(fabric, wi, wo, uv=[(0.01, 0.02), (0.5, 0.5)], level=level)
    assert (gap <= 1e-9 * thread).all()
    assert (thread > 0).all()


@pytest.mark.parametrize("level", ["weave", "thread"])
@pytest.mark.parametrize("shadow", METHODS)
@pytest.mark.parametrize("law", often(["masked", "projected"], ("projected",)))
def test_shadowing_multiplies_by_the_light_that_arrives_or_by_that_over_its_mean(
    law, shadow, level
):
    fabric = replace(PRESETS["polyester_satin_charmeuse"], surface_law=law)
    places, wi = spread_places(400), random_directions(400, 4)
    open_sky = surface.evaluate(fabric, wi, VIEWS["normal"], uv=places, level=level)
    shadowed = surface.evaluate(fabric, wi, VIEWS["normal"], uv=places, level=level, shadow=shadow)
    g = shadowing(fabric, wi, places, shadow)
    if law == "masked" and shadow != "none":
        cloth = compile_fabric(fabric, precision=np.float64)
        tables, hit = compile_shadow(fabric, shadow, precision=np.float64), lookup(fabric, places)
        at = zip(hit.set, hit.thread, hit.position, hit.across, strict=True)
        mean = np.array(
            [mean_lit(R, cloth, tables, Hit(*p, 0.0), *w) for p, w in zip(at, wi, strict=True)]
        )
        # Where hardly anything arrives, what is missing is spread over the stretch.
        g = g / np.maximum(mean, LEAST_LIGHT) + 1 - mean / np.maximum(mean, LEAST_LIGHT)
    assert shadowed == pytest.approx(open_sky * g[:, None], rel=1e-6, abs=1e-12)


def test_level_far_has_no_place_and_takes_no_shadow():
    fabric = PRESETS["silk_shot"]
    open_sky = surface.evaluate(fabric, WI, WO)
    assert (surface.evaluate(fabric, WI, WO, shadow="horizon") == open_sky).all()


@pytest.mark.parametrize("level", surface.LEVELS)
def test_in_mixed_cloth_each_thread_scatters_by_its_own_model(level):
    fabric = PRESETS["silk_shot"]
    black = replace(fabric.threads["Warp"], albedo=(0.0,) * 3, ior=1.0, model="conserving")
    mixed = replace(fabric, threads={**fabric.threads, "Warp": black})
    law = surface_law(mixed, precision=np.float64)
    assert law.kind == MIXED
    for place, warp in (((0.5, 0.5), True), ((1.5, 0.5), False)):
        hit = lookup(fabric, [place])
        assert (hit.set[0] == WARP) == warp
        found = surface.evaluate(mixed, WI, WO, uv=place, level=level)
        alone = surface.evaluate(fabric, WI, WO, uv=place, level=level)
        if level == "far":
            assert (found <= alone + 1e-12).all()
            assert found.sum() > 0.5 * alone.sum()
        elif warp:
            assert (found == 0).all()
        else:
            assert found == pytest.approx(alone, rel=1e-9)
    assert law_value(R, law, FAR, NOWHERE, *WI[0], *-WO[0]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", ["silk_crepe_de_chine", "polyester_satin_charmeuse", "velvet"])
def test_the_loop_that_looks_up_once_is_weave_by_the_horizon(name):
    fabric = PRESETS[name]
    places, wi, wo = spread_places(1500), random_directions(1500, 4), random_directions(1500, 5)
    cloth = compile_fabric(fabric, precision=np.float64)
    shadow = compile_shadow(fabric, "horizon", precision=np.float64)
    out = np.empty((3, 1500))
    surface.weave_all(
        R, cloth, shadow, surface_tables(fabric), places,
        np.ascontiguousarray(wi.T), np.ascontiguousarray(wo.T), out,
    )  # fmt: skip
    expected = surface.evaluate(fabric, wi, wo, uv=places, level="weave", shadow="horizon")
    assert out.T == pytest.approx(expected, rel=1e-9, abs=1e-12)
