"""The three forms of the BTF."""

from __future__ import annotations

import json
import os
import subprocess

import numpy as np
import pytest

from fabricusd.appearance.weave.lookup import lookup
from fabricusd.bake.btf.factored import (
    factored,
    read_atlas,
    read_factored,
    write_atlas,
    write_factored,
)
from fabricusd.bake.btf.factors import entries, factors
from fabricusd.bake.btf.matrix import btf_of, ring_directions, table
from fabricusd.bake.btf.ubo import read_ubo, write_ubo
from fabricusd.bake.btf.write import FORMS, between, read_form, write_btf
from fabricusd.bake.error.accuracy import PAIRS, pairs_between
from fabricusd.bake.texels.law_values import cloth_law, law_values
from fabricusd.errors import FabricError
from fabricusd.schema import load, published_names
from tests.appearance.presets import often

RINGS = ((0.0, 1), (30.0, 6), (60.0, 10))


@pytest.fixture(scope="module")
def small():
    return btf_of(
        load("polyester_satin_charmeuse"), per_thread=4, directions=ring_directions(RINGS)
    )


def test_there_are_151_directions_as_in_measured_btfs():
    directions = ring_directions()
    assert len(directions) == 151
    assert np.allclose(np.linalg.norm(directions, axis=1), 1.0)


def test_the_table_is_level_weave_averaged_over_a_texel(small):
    """Node by node it is exact; between nodes the lobe is taken as linear. With its mean shadow."""
    rng = np.random.default_rng(0)
    d = len(small.directions)
    rows, texels = rng.integers(0, d * d, 120), rng.integers(0, len(small.texels), 120)
    view, light = np.divmod(rows, d)
    y, x = np.divmod(texels, small.size[1])
    place = (np.arange(4) + 0.5) / 4
    total, law = np.zeros((120, 3)), cloth_law(small.fabric)
    for a in place:
        for c in place:
            uv = np.stack((x + a, y + c), axis=1) / 4
            hit = lookup(small.fabric, uv)
            for k in np.flatnonzero(~hit.gap):
                wi, wo = (small.directions[at[k], :, None] for at in (light, view))
                angle = hit.angle[k : k + 1]
                which, kind = int(hit.set[k]), int(hit.thread[k])
                total[k] += law_values(law, which, kind, angle, wi, wo)[:, 0]
    true = total / 16 / small.directions[light][:, 2:]
    got = table(small, rows, texels)
    assert np.abs(got - true).mean() < 0.02 * true.mean()


@pytest.mark.parametrize("joint", [True, False])
def test_the_rank_is_the_least_that_meets_the_bound(small, joint):
    made = factors(small, joint=joint, max_error=1.0)
    assert made.delta_e <= 1.0
    assert factors(small, joint=joint, rank=made.rank - 1).delta_e > 1.0


def test_all_components_give_the_table_back(small):
    made = factors(small, joint=True, rank=10**6)
    rows, texels = np.arange(200), np.arange(200)
    assert np.allclose(entries(made, rows, texels), table(small, rows, texels), atol=1e-4)


@pytest.mark.parametrize("joint", [True, False])
def test_what_is_written_as_btf_is_read_back(small, tmp_path, joint):
    made = factors(small, joint=joint, max_error=1.0)
    write_ubo(tmp_path / "a.btf", small, made)
    back = read_ubo(tmp_path / "a.btf")
    assert back.size == small.size
    assert np.allclose(back.directions, small.directions, atol=1e-6)
    rows, texels = np.arange(200), np.arange(200)
    assert np.allclose(entries(back.factors, rows, texels), entries(made, rows, texels), atol=2e-2)


def test_a_damaged_btf_is_refused(small, tmp_path):
    path = tmp_path / "a.btf"
    path.write_bytes(b"not one")
    with pytest.raises(FabricError, match=r"not a \.btf"):
        read_ubo(path)
    write_ubo(path, small, factors(small, joint=True, rank=2))
    path.write_bytes(path.read_bytes()[:400])
    with pytest.raises(FabricError, match="damaged"):
        read_ubo(path)


@pytest.mark.parametrize("joint", [True, False])
def test_an_independent_reader_finds_the_values_that_were_written(small, tmp_path, joint):
    """`btf-extractor` of PyPI in an environment of its own, named by BTF_EXTRACTOR_PYTHON."""
    python = os.environ.get("BTF_EXTRACTOR_PYTHON")
    if not python:
        pytest.skip("BTF_EXTRACTOR_PYTHON names no Python with btf-extractor")
    made = factors(small, joint=joint, max_error=1.0)
    path = tmp_path / "a.btf"
    write_ubo(path, small, made)
    d = len(small.directions)
    pairs = [(0, 0), (3, 9), (16, 2)]
    script = (
        "import json, sys, numpy as np\n"
        "from btf_extractor import Ubo2014\n"
        "btf = Ubo2014(sys.argv[1])\n"
        "pairs = json.loads(sys.argv[2])\n"
        "images = [btf._angleindex_to_image_unsafe(*p)[..., ::-1].tolist() for p in pairs]\n"
        "print(json.dumps([btf.img_shape, len(btf.angles_set), images]))\n"
    )
    shown = subprocess.run(
        [python, "-c", script, str(path), json.dumps(pairs)],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    shape, conditions, images = json.loads(shown.stdout)
    assert tuple(shape[:2]) == small.size[::-1]
    assert conditions == d * d
    h, w = small.size
    back = read_ubo(path).factors
    for (light, view), image in zip(pairs, images, strict=True):
        rows = np.full(h * w, view * d + light)
        # The reader turns pictures over: its first row is the top.
        ours = entries(back, rows, np.arange(h * w)).reshape(h, w, 3)[::-1]
        assert np.allclose(np.array(image), ours, atol=2e-3)


def test_the_factored_form_and_the_atlas_say_the_same_after_reading(small, tmp_path):
    one = factored(small, factors(small, joint=True, max_error=1.0))
    write_factored(tmp_path / "a.npz", one)
    write_atlas(tmp_path / "a", one)
    weave = np.random.default_rng(0).random((50, 2)) * 100
    wi, wo = np.array([0.5, 0.1, 0.86]), np.array([-0.2, 0.3, 0.93])
    wi, wo = wi / np.linalg.norm(wi), wo / np.linalg.norm(wo)
    true = one.evaluate(weave, wi, wo)
    assert np.allclose(read_atlas(tmp_path / "a").evaluate(weave, wi, wo), true, atol=1e-4)
    assert np.allclose(read_factored(tmp_path / "a.npz").evaluate(weave, wi, wo), true, atol=2e-2)


def test_the_factored_form_repeats_with_the_weave(small):
    one = factored(small, factors(small, joint=True, rank=8))
    weave = np.random.default_rng(0).random((50, 2)) * 5
    wi = wo = np.array([0.0, 0.0, 1.0])
    assert np.allclose(
        one.evaluate(weave, wi, wo), one.evaluate(weave + np.array([10, -15]), wi, wo)
    )


def test_every_form_is_written_with_its_record(tmp_path):
    records = write_btf(load("linen_plain"), tmp_path, ("ubo", "atlas"), per_thread=4)
    assert [r["form"] for r in records] == ["ubo", "atlas"]
    for record in records:
        assert record["delta_e"] <= 1.0
        assert all((tmp_path / f).is_file() for f in record["files"])
    with pytest.raises(FabricError, match="must be one of ubo"):
        write_btf(load("linen_plain"), tmp_path, ("dds",))


@pytest.mark.parametrize("name", often(published_names()))
def test_each_form_is_within_its_stated_bound_on_pairs_held_back(name, tmp_path):
    """Read by its own loader, against level `weave` under twenty pairs of directions."""
    fabric, held_back = load(name), pairs_between(20, skip=PAIRS)
    records = write_btf(
        fabric, tmp_path, FORMS, per_thread=4, directions=ring_directions(RINGS), max_error=0.5
    )
    read = [read_form(r["form"], tmp_path / fabric.name, per_thread=4) for r in records]
    for record, errors in zip(records, between(fabric, read, held_back), strict=True):
        assert errors.max() <= record["bound"], record["form"]


def test_the_bound_bites_when_the_btf_is_of_another_fabric(tmp_path):
    linen, silk = load("linen_plain"), load("silk_crepe_de_chine")
    (record,) = write_btf(linen, tmp_path, ("factored",), per_thread=4)
    other = read_form("factored", tmp_path / linen.name)
    assert between(silk, [other]).max() > record["bound"]
