"""The plugin for Mitsuba 3 has the values of the law, and samples what it says."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace

import numpy as np
import pytest
from materials.lobes.mixtures import directions

from fabricusd.appearance import surface
from fabricusd.materials.fit.judge import hemisphere
from fabricusd.materials.targets.mitsuba.export import fabric_content
from fabricusd.schema import load

PRESETS = (
    ("wool_flannel", "projected"), ("silk_shot", "projected"), ("silk_shot", "visible"),
    ("polyester_satin_charmeuse", "unmasked"), ("velvet", "masked"),
)  # fmt: skip


@pytest.fixture(scope="module")
def mi():
    mitsuba = pytest.importorskip("mitsuba")
    try:
        mitsuba.set_variant("llvm_ad_rgb")
        # The backend looks for LLVM when it is first used.
        assert mitsuba.Float(1.0) + 1.0 == 2.0
    except (ImportError, RuntimeError):
        pytest.skip("Mitsuba finds no LLVM; set DRJIT_LIBLLVM_PATH")
    import drjit

    # LLVM 14 and 15 abort the process on code of Dr.Jit 1.5 for AVX-512.
    if drjit.detail.llvm_version()[0] < 16:
        pytest.skip("Mitsuba needs LLVM 16 or later; set DRJIT_LIBLLVM_PATH")
    importlib.import_module("fabricusd.materials.targets.mitsuba.fabricusd_cloth")
    return mitsuba


@pytest.fixture(scope="module", params=PRESETS)
def cloth(request, mi, tmp_path_factory):
    """A fabric, and its file."""
    name, law = request.param
    fabric = replace(load(name), surface_law=law)
    path = tmp_path_factory.mktemp("mitsuba") / "cloth.json"
    path.write_text(json.dumps(fabric_content(fabric)))
    return fabric, path


def plugin(mi, path, **more):
    return mi.load_dict({"type": "fabricusd_cloth", "filename": str(path), **more})


def seen(mi, wo):
    """A place that is seen from wo (3,) or (n, 3)."""
    si = dr_zeros(mi)
    si.wi = mi.Vector3f(np.ascontiguousarray(np.asarray(wo, np.float32).T))
    return si


def dr_zeros(mi):
    import drjit as dr

    return dr.zeros(mi.SurfaceInteraction3f)


@pytest.mark.parametrize("turn", [0.0, 30.0])
def test_its_values_are_those_of_the_law(mi, cloth, turn):
    fabric, path = cloth
    wi, wo = directions(2000, seed=4)
    bsdf = plugin(mi, path, rotation=turn)
    given = mi.Vector3f(np.ascontiguousarray(wi.T.astype(np.float32)))
    ours = np.array(bsdf.eval(mi.BSDFContext(), seen(mi, wo), given)).T
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    frame = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    truth = surface.evaluate(fabric, wi @ frame.T, wo @ frame.T, level="far", shadow="horizon")
    assert truth.max() > 0.0
    assert np.abs(ours - truth).max() < 1e-3 * truth.max()
    bright = truth > 1e-3 * truth.mean()
    assert np.abs(ours / np.where(bright, truth, 1.0) - 1.0)[bright].max() < 1e-3


def test_it_samples_by_its_density(mi, cloth):
    from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain

    said = f'<string name="filename" value="{cloth[1]}"/>'
    context = mi.BSDFContext()
    context.component = 0
    sample, density = BSDFAdapter("fabricusd_cloth", said, wi=[0.5, 0.2, 0.84], ctx=context)
    test = ChiSquareTest(
        domain=SphericalDomain(), sample_func=sample, pdf_func=density, sample_dim=3, res=31,
        sample_count=200_000, ires=8,
    )  # fmt: skip
    assert test.run()


def test_in_a_furnace_its_samples_and_gaps_have_the_energy_of_the_law(mi, cloth):
    fabric, path = cloth
    wo = np.array([0.4, -0.3, 0.0])
    wo[2] = np.sqrt(1.0 - wo @ wo)
    count = 200_000
    numbers = np.random.default_rng(1).random((3, count), np.float32)
    bsdf = plugin(mi, path)
    si = seen(mi, np.tile(wo, (count, 1)))
    sample, weight = bsdf.sample(
        mi.BSDFContext(), si, mi.Float(numbers[0]), mi.Point2f(numbers[1:])
    )
    weight, kind = np.array(weight).T, np.array(sample.sampled_component)
    lights = hemisphere(20_000)
    values = surface.evaluate(fabric, lights, np.tile(wo, (20_000, 1)), shadow="horizon")
    albedo = values.mean(axis=0) * 2.0 * np.pi
    reflected = np.where(kind[:, None] == 0, weight, 0.0)
    error = reflected.std(axis=0) / np.sqrt(count)
    assert np.all(np.abs(reflected.mean(axis=0) - albedo) < 5.0 * error + 2e-3 * albedo)
    gap = np.array(bsdf.eval_null_transmission(seen(mi, wo[None])))[0, 0]
    assert (kind == 1).mean() == pytest.approx(gap, abs=5.0 / np.sqrt(count))
    assert np.allclose(weight[kind == 1], 1.0, rtol=1e-4)


def test_the_back_is_as_the_front(mi, cloth):
    wi, wo = directions(100)
    bsdf, flip = plugin(mi, cloth[1]), np.array([1.0, 1.0, -1.0])
    front, back, through = (
        np.array(bsdf.eval(mi.BSDFContext(), seen(mi, o), mi.Vector3f(i.T.astype(np.float32))))
        for i, o in ((wi, wo), (wi * flip, wo * flip), (wi * flip, wo))
    )
    assert np.allclose(front, back)
    assert not through.any()


def test_another_file_is_refused(mi, tmp_path):
    path = tmp_path / "other.json"
    path.write_text("{}")
    with pytest.raises(Exception, match="is no fabric of version 3"):
        plugin(mi, path)
