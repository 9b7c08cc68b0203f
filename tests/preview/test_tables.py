"""The tables of a picture survive the cache, and say what the surface laws say."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.appearance import surface
from fabricusd.cache import packed, unpacked
from fabricusd.preview.fabrics import fabric_of
from fabricusd.preview.kernels.sky import sky_light
from fabricusd.preview.tables import _GROUPS, Tables, _made, tables_of
from fabricusd.preview.values import look_up, value_far, value_near

NAMES = ("linen_plain", "denim")


def directions(n: int, seed: int) -> np.ndarray:
    """(n, 3) unit vectors above the cloth."""
    w = np.random.default_rng(seed).normal(size=(n, 3))
    w[:, 2] = np.abs(w[:, 2]) + 0.05
    return w / np.linalg.norm(w, axis=1, keepdims=True)


def rows(w: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(w.T, np.float32)


@pytest.mark.parametrize("name", NAMES)
def test_tables_are_read_as_they_were_made(name):
    fabric, _ = fabric_of(name)
    made = _made(fabric)
    kinds = {"published": type(made.published), **_GROUPS}
    read = Tables(**unpacked(packed(made._asdict()), kinds))
    for group in ("published", "conserving", "cloth", "shadow", "yarn", "fuzz"):
        wanted, found = getattr(made, group), getattr(read, group)
        if wanted is None:
            assert found is None
            continue
        for field, value in wanted._asdict().items():
            other = getattr(found, field)
            assert np.array_equal(value, other), field
            assert np.asarray(value).dtype == np.asarray(other).dtype, field


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("level", ["far", "weave", "thread"])
def test_values_are_those_of_the_surface_laws(name, level):
    fabric, _ = fabric_of(name)
    tables = tables_of(fabric)
    wi, wo = directions(500, 1), directions(500, 2)
    uv = np.random.default_rng(3).uniform(0, 20, (500, 2))
    if level == "far":
        shadow = surface.mean_shadow(fabric)
        wanted = surface.evaluate(fabric, wi, wo, shadow=shadow)
        found = value_far(tables, rows(wi), rows(wo)).T
    else:
        wanted = surface.evaluate(fabric, wi, wo, uv, level, "horizon")
        found = value_near(tables, level, look_up(tables, uv), rows(wi), rows(wo)).T
    error = np.abs(found - wanted).max(axis=1) / np.maximum(wanted.max(axis=1), 1e-3)
    # A place at the very edge of a thread may fall to the other side in float32.
    assert np.quantile(error, 0.99) < 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_the_sky_is_the_integral_over_its_directions(name):
    fabric, _ = fabric_of(name)
    tables = tables_of(fabric)
    wo, up = directions(6, 4), np.array([0.48, 0.6, 0.64])
    z, w = np.polynomial.legendre.leggauss(48)
    z, w = 0.5 * (z + 1), 0.5 * w
    turn = (np.arange(128) + 0.5) * (2 * np.pi / 128)
    height, angle = (a.ravel() for a in np.meshgrid(z, turn, indexing="ij"))
    flat = np.sqrt(1 - height**2)
    sky = np.stack((flat * np.cos(angle), flat * np.sin(angle), height), axis=1)
    light = (0.3 + 0.2 * sky @ up) * np.repeat(w, 128) * (2 * np.pi / 128)
    for view in wo:
        f = surface.evaluate(fabric, sky, view, shadow=surface.mean_shadow(fabric))
        found = np.zeros((3, 1), np.float32)
        sky_light(
            np.float32, tables.sky, np.float32(0.3), np.float32(0.2), rows(view[None]),
            rows(up[None]), found,
        )  # fmt: skip
        assert found[:, 0] == pytest.approx(light @ f, rel=0.02)
