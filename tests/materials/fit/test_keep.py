"""Fits that are kept in the cache."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.materials.fit import keep
from fabricusd.materials.fit.fit import Fitted, bounds_met
from fabricusd.materials.fit.target import TexelSample
from fabricusd.materials.networks.look import Look
from fabricusd.schema import load

FITTED = Fitted(
    look=Look(specular_ior=2.5, fuzz_color=(0.1, 0.2, 0.3), transmission_scale=(1.0, 0.5, 1.0)),
    delta_e=1.5, delta_e_95=4.0, albedo=0.1, threads_delta_e=None, score=1.6, start_delta_e=3.0,
    start_score=3.1, pairs=1536,
)  # fmt: skip
TEXELS = TexelSample(
    base=np.full((1, 3), 0.5), smooth=np.full(1, 0.4), rough=np.full(1, 0.9),
    opacity=np.ones(1), normal=np.array([[0.0, 0.0, 1.0]]), tangent=np.array([[1.0, 0.0, 0.0]]),
    weight=np.ones(1),
)  # fmt: skip


@pytest.fixture
def fits(tmp_path, monkeypatch):
    """The fits that were made, by kind; each takes what a fit would import."""
    monkeypatch.setenv("FABRICUSD_CACHE_DIR", str(tmp_path))
    made = []

    def fake(kind, texels, fabric, *, baked):
        # As colour-science does when a fit imports it.
        np.set_printoptions(legacy="1.13")
        made.append(kind)
        return FITTED

    monkeypatch.setattr(keep, "fit", fake)
    yield made
    np.set_printoptions(legacy=False)


def kept(kind="openpbr", texels=TEXELS, fabric=None):
    said = []
    found = keep.kept_fit(
        kind, texels, fabric or load("linen_plain"), baked=texels, waiting=lambda: said.append(kind)
    )
    return found, said


def test_a_fit_is_made_once_and_comes_back_whole(fits):
    assert kept() == (FITTED, ["openpbr"])
    assert kept() == (FITTED, [])
    assert fits == ["openpbr"]


@pytest.mark.parametrize(
    "other",
    [
        {"kind": "preview"},
        {"texels": replace(TEXELS, smooth=np.full(1, 0.41))},
        {"fabric": replace(load("linen_plain"), masking_width=0.3)},
        {"fabric": load("silk_shot")},
    ],
)
def test_another_surface_texel_or_cloth_is_fitted_again(fits, other):
    kept()
    assert kept(**other)[1]
    assert len(fits) == 2


def test_the_last_digit_of_a_texel_does_not_matter(fits):
    kept()
    moved = replace(TEXELS, base=np.nextafter(TEXELS.base, 1.0))
    assert kept(texels=moved)[1] == []


def test_a_parameter_at_its_bound_is_named_unless_it_has_no_effect():
    assert bounds_met("openpbr", Look()) == []
    assert bounds_met("openpbr", Look(specular_ior=20.0)) == ["specular_ior is at its bound, 20"]
    assert bounds_met("preview", Look(fuzz_weight=1.0)) == []
