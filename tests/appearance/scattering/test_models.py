"""The registry of thread models: names, numbers, and what each model must bring."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fabricusd.appearance.published import tables
from fabricusd.appearance.published.columns import NODE_HALF
from fabricusd.appearance.scattering import columns, lobes, models, table, terms
from fabricusd.appearance.scattering.model import CONSERVING, PUBLISHED
from fabricusd.appearance.weave.quadrature import CELLS, MOST_NODES, POINTS, Rule, default_rule
from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, MODELS, Thread
from tests.appearance.presets import PRESETS, with_model

R = np.float64


def test_every_module_of_the_folder_is_a_model_with_a_number():
    files = Path(models.__file__).parent.glob("*.py")
    assert {f.stem for f in files} - {"__init__"} == set(MODELS)
    assert len(models.REGISTRY) == len(MODELS)


def test_every_model_follows_one_of_the_two_laws():
    assert sorted((*models.PUBLISHED_MODELS, *models.CONSERVING_MODELS)) == list(terms.ALL)
    assert set(models.names(PUBLISHED)) | set(models.names(CONSERVING)) == set(MODELS)


def test_the_columns_have_a_place_of_their_own_each():
    places = [v for k, v in vars(columns).items() if k.isupper() and isinstance(v, int)]
    tables = {columns.TRANSMISSION_ENTRIES, columns.COMPLETION, columns.COLUMNS}
    places = sorted(set(places) - tables)
    pairs = [columns.SURFACE_LOBE, columns.VOLUME_LOBE]
    assert sorted(places + [p + 1 for p in pairs]) == list(range(columns.CONSTANTS + 1))


@pytest.mark.parametrize("name", MODELS)
def test_a_row_names_its_model_and_its_law(name):
    row = table.thread_row(Thread(albedo=(2.0, 0.5, 0.5)), name)
    assert models.REGISTRY[int(row[columns.MODEL])] is models.named(name)
    assert row[columns.LAW] == models.named(name).law
    assert row[columns.ALBEDO_R] == min(2.0, models.named(name).most_albedo)


@pytest.mark.parametrize("number", terms.CELL_MODELS)
def test_lobes_averaged_over_a_stretch_are_the_mean_of_the_lobes(number):
    # In the plane of the thread theta_h moves by as much as the tangent angle.
    row = table.thread_row(
        Thread(gamma_surface=4 * DEGREE, gamma_volume=9 * DEGREE), MODELS[number]
    )
    theta_i, theta_o = 0.5, -0.42
    for half in (1e-4, 0.02, 0.1):
        x, weight = np.polynomial.legendre.leggauss(200)

        def at(turn):
            i, o = theta_i + turn, theta_o + turn
            return terms.lobes(R, number, row, np.sin(i), np.cos(i), np.sin(o), np.cos(o))

        want = 0.5 * weight @ np.array([at(half * turn) for turn in x])
        sines = np.sin(theta_i), np.cos(theta_i), 1.0, np.sin(theta_o), np.cos(theta_o), 1.0
        got = terms.cell_lobes(R, number, row, half, *sines)
        assert got == pytest.approx(want, rel=1e-5)


@pytest.mark.parametrize("name", MODELS)
def test_a_narrower_lobe_is_higher(name):
    number = MODELS.index(name)
    values = [
        terms.lobes(
            R, number, table.thread_row(Thread(gamma_surface=s), name), 0.3, 0.954, -0.3, 0.954
        )[0]
        for s in (lobes.NARROWEST, 0.01, 0.1)
    ]
    assert values[0] > values[1] > values[2] > 0


def test_lobes_without_a_mean_are_integrated_by_points_alone(monkeypatch):
    fabric = with_model(PRESETS["silk_shot"], "microcylinder")
    narrow = replace(
        fabric, threads={k: replace(t, gamma_surface=1e-3) for k, t in fabric.threads.items()}
    )
    assert default_rule(narrow).form == CELLS
    rule = default_rule(narrow, cells=False)
    assert rule.form == POINTS
    monkeypatch.setattr(tables, "has_cell_lobes", lambda fabric: False)
    made = tables.surface_tables(narrow)
    assert 0 < len(made.nodes) <= MOST_NODES
    assert not made.nodes[:, NODE_HALF].any()
    with pytest.raises(FabricError, match="the form of the rule must be points"):
        tables.surface_tables(narrow, rule=Rule(CELLS, 0.1))
