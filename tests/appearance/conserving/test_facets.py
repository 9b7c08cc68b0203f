"""What facets send where: dark without factors, and exact for the factors that kernels read."""

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.conserving import facets
from fabricusd.appearance.conserving.grid import entry_angles, mean_share
from tests.appearance.presets import PRESETS

WOVEN = [name for name in PRESETS if name != "velvet"]


@pytest.mark.parametrize("name", WOVEN)
def test_facets_without_factors_are_dark(name):
    # Measured: 0.20 (linen) to 0.32 (shot) reflected, 0.10 (satin) to 0.32 (shot) transmitted.
    sent = facets.white_facets(PRESETS[name], draws=1024).sent.sum(axis=(2, 3))
    assert 0.19 < sent[:, 0].min() < sent[:, 0].max() < 0.34
    assert 0.09 < sent[:, 1].min() < sent[:, 1].max() < 0.34


def test_velvet_reflects_hardly_anything_once():
    sent = facets.white_facets(PRESETS["velvet"], draws=512).sent.sum(axis=(2, 3))
    assert mean_share(sent[:, 0].reshape(facets.PILE_TABLE[:2])) < 0.04


def test_the_surface_of_a_thread_that_reflects_nothing_has_no_share():
    fabric = PRESETS["linen_plain"]
    up = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
    some = facets.surface_shares(fabric, up)
    assert np.all((some > 0.02) & (some < 0.2))
    threads = {k: replace(t, surface_gain=0.0) for k, t in fabric.threads.items()}
    np.testing.assert_allclose(
        facets.surface_shares(replace(fabric, threads=threads), up), 0, atol=1e-6
    )


def test_a_constant_factor_sends_what_no_factor_sends_times_its_square():
    # The 16 entries that a direction is shared between have weights that sum to 1.
    found = facets.white_facets(PRESETS["silk_shot"], draws=256)
    matrix = found.sent[:, 0, facets.VOLUME].astype(float)
    np.testing.assert_allclose(2.0 * (matrix @ np.full(len(matrix), 2.0)), 4.0 * matrix.sum(axis=1))
    theta, phi = entry_angles(*found.shape)
    assert theta.shape == phi.shape == found.shape


def test_cloths_that_differ_in_colour_alone_share_their_facets_and_others_do_not():
    fabric = PRESETS["silk_shot"]

    def changed(**change):
        return replace(
            fabric, name="other", back=fabric,
            threads={k: replace(t, **change) for k, t in fabric.threads.items()},
        )  # fmt: skip

    found = facets.white_facets(fabric, draws=16)
    assert facets.white_facets(changed(albedo=(0.3, 0.2, 0.1)), draws=16).sent is found.sent
    assert not found.sent.flags.writeable
    for change in ({"ior": 1.6}, {"gamma_surface": 0.3}, {"isotropic": 0.6}):
        other = facets.white_facets(changed(**change), draws=16)
        assert np.abs(other.sent - found.sent).max() > 0
