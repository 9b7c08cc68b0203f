"""Level far: against the model as it is written, its quadrature, its precision."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.appearance import plain, surface
from fabricusd.appearance.accuracy import choose_rule, measure_rule, spread_pairs
from fabricusd.appearance.conserving.grid import without_border
from fabricusd.appearance.law import surface_law
from fabricusd.appearance.laws.masked import plain_masked
from fabricusd.appearance.published.far import far_value, far_values, normalization
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering import models
from fabricusd.appearance.scattering.model import PUBLISHED as LAW
from fabricusd.appearance.weave.quadrature import (
    CANDIDATES,
    CELLS,
    DEFAULT,
    NARROW,
    POINTS,
    Rule,
    count_nodes,
    curve_nodes,
    default_rule,
)
from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, TangentCurve
from tests.appearance.directions import random_directions
from tests.appearance.presets import PRESETS, often, with_model

PUBLISHED = models.names(LAW)
CASES = [(n, m) for n in PRESETS for m in PUBLISHED]
STEPS = TangentCurve(
    positions=(0, 1, 1, 3, 3, 4), angles=tuple(x * DEGREE for x in (-30, -30, 8, 8, 41, 41))
)
"""A curve of level pieces: every quadrature takes one node on each, so all of them agree."""

WI, WO = random_directions(400, 1), random_directions(400, 2)


def with_threads(fabric, **changes):
    return replace(fabric, threads={k: replace(t, **changes) for k, t in fabric.threads.items()})


def narrow(fabric, degrees):
    return with_threads(fabric, gamma_surface=degrees * DEGREE, gamma_volume=2 * degrees * DEGREE)


@pytest.mark.parametrize(("name", "model"), often(CASES))
def test_on_level_pieces_far_is_the_written_model_to_rounding(name, model):
    fabric = with_threads(with_model(PRESETS[name], model), curve=STEPS)
    found = surface.evaluate(fabric, WI, WO)
    written = plain.far(fabric, WI, WO, per_segment=1)
    assert found == pytest.approx(written, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("name", "model"), often(CASES))
def test_far_is_the_dense_integral_over_the_curve_within_its_bound(name, model):
    fabric = with_model(PRESETS[name], model)
    found = surface.evaluate(fabric, WI, WO, max_error=1e-3)
    dense = plain.far(fabric, WI, WO, per_segment=200)
    assert np.abs(found - dense).mean() <= 1e-3 * dense.mean()


@pytest.mark.parametrize("name", often(PRESETS))
def test_conserving_far_is_the_written_model_to_rounding_on_level_pieces(name):
    fabric = with_threads(with_model(PRESETS[name], "conserving"), curve=STEPS)
    wi, wo = random_directions(60, 3, upper=False), random_directions(60, 4, upper=False)
    fabric = replace(fabric, opaque=False)
    law = surface_law(fabric, precision=np.float64, multiple=False)
    assert (law.conserving.strength == 0).all()
    found = surface.evaluate(fabric, wi, wo, multiple=False)
    written = plain.conserving_far(
        fabric, wi, wo, per_segment=1, sides=without_border(law.conserving.sides)
    )
    # The tables of E and of the light that is completed have other nodes: at 0.1 degrees from the
    # normal plane x of a narrow lobe differs by 4e-4 of itself, 2e-5 of the albedo.
    assert found == pytest.approx(written, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("name", often(PRESETS))
def test_the_scalar_and_the_vectorised_kernel_agree(name):
    for precision, tolerance in ((np.float64, 1e-12), (np.float32, 2e-5)):
        tables = surface_tables(PRESETS[name], precision=precision)
        wi, wo = (np.ascontiguousarray(w[:50].T, precision) for w in (WI, WO))
        out = np.empty_like(wi)
        far_values(precision, tables, wi, wo, out, 0, 50)
        one_by_one = [far_value(precision, tables, *wi[:, k], *wo[:, k]) for k in range(50)]
        assert out.T == pytest.approx(np.array(one_by_one), rel=tolerance, abs=1e-9)


@pytest.mark.parametrize(("name", "model"), often(CASES))
def test_single_precision_is_within_a_ten_thousandth_away_from_the_singular_set(name, model):
    fabric = with_model(PRESETS[name], model)
    wi, wo = spread_pairs(20_000)
    away = (wi[2] > 0.05) & (wo[2] > 0.05)
    wi, wo = (np.ascontiguousarray(w[:, away]) for w in (wi, wo))
    values = {}
    for precision in (np.float64, np.float32):
        out = np.empty(wi.shape, precision)
        far_values(
            precision, surface_tables(fabric, precision=precision),
            wi.astype(precision), wo.astype(precision), out, 0, wi.shape[1],
        )  # fmt: skip
        values[precision] = out.astype(np.float64)
    exact = values[np.float64]
    some = exact > 1e-4 * exact.mean()
    error = np.abs(values[np.float32] - exact)[some] / exact[some]
    assert np.quantile(error, 0.999) < 1e-4


def test_q_is_the_written_normalization():
    for name, fabric in PRESETS.items():
        tables = surface_tables(fabric, rule=Rule(POINTS, 0.25))
        written = plain.normalization(fabric, WI[:40], WO[:40], per_segment=100)
        found = [normalization(np.float64, tables, *WI[k], *WO[k]) for k in range(40)]
        assert np.array(found) == pytest.approx(written, abs=2e-4), name


@pytest.mark.parametrize("name", often(PRESETS))
@pytest.mark.parametrize("bound", [0.03, 3e-3, 3e-4])
def test_the_quadrature_meets_the_bound_that_the_caller_gives(name, bound):
    rule = choose_rule(PRESETS[name], bound)
    assert measure_rule(PRESETS[name], rule, pairs=9000).error <= bound


@pytest.mark.parametrize("name", often(PRESETS))
def test_the_bound_bites_on_the_rule_that_is_one_cheaper(name):
    rule = choose_rule(PRESETS[name], 3e-3)
    costs = {r: curve_nodes(PRESETS[name], r).cost for r in CANDIDATES}
    cheaper = [r for r in CANDIDATES if costs[r] < costs[rule]]
    assert all(1.5 * measure_rule(PRESETS[name], r).error > 3e-3 for r in cheaper)


def test_a_bound_that_nothing_meets_is_refused_with_what_can_be_had():
    with pytest.raises(FabricError, match=r"max_error is 1e-12; .* reaches"):
        choose_rule(PRESETS["linen_plain"], 1e-12)
    with pytest.raises(FabricError, match="must be above 0"):
        choose_rule(PRESETS["linen_plain"], 0.0)


@pytest.mark.parametrize("degrees", [2.0, 0.1, 1e-3, 1e-7])
def test_narrow_lobes_take_cells_instead_of_nodes_without_end(degrees):
    fabric = narrow(PRESETS["linen_plain"], degrees)
    assert (default_rule(fabric) == NARROW) == (degrees < 2.0)
    assert len(curve_nodes(fabric, default_rule(fabric)).psi0) <= 128
    value = surface.evaluate(fabric, WI, WO)
    assert np.isfinite(value).all()
    assert (value >= 0).all()
    assert value.max() > 0


def test_cells_are_points_where_the_lobes_are_wide():
    fabric = narrow(PRESETS["silk_crepe_de_chine"], 20.0)
    fine = measure_rule(fabric, Rule(CELLS, 0.3 * DEGREE))
    assert fine.error < 2e-4


def test_cells_beat_points_of_the_same_cost_on_narrow_lobes():
    fabric = narrow(PRESETS["linen_plain"], 0.5)
    cells = measure_rule(fabric, Rule(CELLS, 2.5 * DEGREE))
    spacing = 1.0
    while curve_nodes(fabric, Rule(POINTS, spacing)).cost > cells.cost:
        spacing *= 1.2
    assert 3 * cells.error < measure_rule(fabric, Rule(POINTS, spacing)).error


@pytest.mark.parametrize("rule", [*CANDIDATES, DEFAULT])
def test_weights_sum_to_the_covered_area_and_counts_are_what_is_made(rule):
    for fabric in PRESETS.values():
        nodes = curve_nodes(fabric, rule)
        assert nodes.weight.sum() == pytest.approx(1 - plain.gap(fabric))
        assert len(nodes.psi0) == count_nodes(fabric, rule)
        assert (nodes.half > 0).any() == (rule.form == CELLS)


@given(
    x=st.floats(-math.pi, math.pi),
    y=st.floats(-math.pi, math.pi),
    width=st.floats(0.01, 6.0),
)
def test_masking_lies_between_the_product_and_the_minimum_and_is_symmetric(x, y, width):
    x, y = np.array([x]), np.array([y])
    m = plain_masked(x, y, width)
    mx, my = np.maximum(np.cos(x), 0), np.maximum(np.cos(y), 0)
    assert m <= np.minimum(mx, my) + 1e-15
    assert m >= mx * my - 1e-15
    assert m == pytest.approx(plain_masked(y, x, width), abs=1e-15)


@given(st.integers(0, 5), st.floats(0.02, 1.0), st.floats(0.02, 1.0), st.floats(0, 360))
def test_q_is_symmetric_but_for_the_gap(preset, zi, zo, azimuth):
    fabric = list(PRESETS.values())[preset]
    tables = surface_tables(fabric)._replace(gap=np.float64(0.0))
    wi = (math.sqrt(1 - zi * zi), 0.0, zi)
    a = math.radians(azimuth)
    flat = math.sqrt(1 - zo * zo)
    wo = (flat * math.cos(a), flat * math.sin(a), zo)
    q = normalization(np.float64, tables, *wi, *wo)
    assert q == pytest.approx(normalization(np.float64, tables, *wo, *wi), abs=1e-14)
