"""Tables by direction: what is read is what was entered, between entries what plain NumPy reads."""

import numpy as np
from numba import njit

from fabricusd.appearance import plain
from fabricusd.appearance.conserving.grid import (
    bordered,
    entry_angles,
    mean_share,
    share_at,
    side_at,
    without_border,
)
from fabricusd.kernels.real import KERNEL

ROWS, COLUMNS = 9, 12


@njit(**KERNEL)
def _read(R, sides, table, w, out):
    for k in range(len(w)):
        a, b, c = side_at(R, sides, 1, w[k, 0], w[k, 1], w[k, 2])
        out[k, 0], out[k, 1], out[k, 2] = a, b, c
        out[k, 3] = share_at(R, table, w[k, 0], w[k, 1], w[k, 2])


def _entries(w):
    table = np.random.default_rng(1).uniform(0.2, 0.8, (2, ROWS, COLUMNS, 3))
    # The pole is one direction.
    table[:, 0] = table[:, 0, :1]
    out = np.empty((len(w), 4))
    sides = bordered(table)
    np.testing.assert_array_equal(without_border(sides), table)
    _read(np.float64, sides, np.ascontiguousarray(table[1, :, :, 0]), w, out)
    return table[1], out


def _directions(theta, phi):
    theta, phi = np.ravel(theta), np.ravel(phi)
    return np.stack((np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), 1)


def test_an_entry_is_read_at_its_direction_and_at_the_opposite_one():
    w = _directions(*entry_angles(ROWS, COLUMNS))
    for sign in (1, -1):
        table, out = _entries(sign * w)
        np.testing.assert_allclose(out[:, :3].reshape(table.shape), table, atol=1e-9)


def test_between_entries_kernels_and_plain_numpy_read_the_same():
    w = np.random.default_rng(2).standard_normal((2000, 3))
    w /= np.linalg.norm(w, axis=1)[:, None]
    table, out = _entries(w)
    np.testing.assert_allclose(out[:, :3], plain.between_entries(table, w), atol=1e-9)
    np.testing.assert_allclose(out[:, 3], out[:, 0], rtol=1e-12)


def test_the_mean_is_weighted_by_the_cosine():
    assert abs(mean_share(np.full((ROWS, COLUMNS), 0.3)) - 0.3) < 1e-6
    theta, _ = entry_angles(25, 24)
    assert abs(mean_share(np.cos(theta)) - 2 / 3) < 1e-3
    assert mean_share(np.zeros((0, 0))) == 0
