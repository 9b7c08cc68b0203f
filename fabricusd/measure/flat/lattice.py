"""The weave's period in a photograph, from the peaks of its spectrum.

Cloth that repeats has its power at the points of a lattice of frequencies. The weave says which of
them are bright, in units of one over the pitch of its threads; matching two peaks to two of them
gives both pitches, the turn of the cloth and its shear. The other peaks decide between matches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter

from fabricusd.errors import FabricError
from fabricusd.fabric import Weave
from fabricusd.measure.flat.photograph import Photograph, relative

Floats = NDArray[np.float64]

PEAKS = 10
LEADING = 3
"""Brightest peaks of which one must be the weave's; a fold may be brighter."""
CLEAR = 8.0
"""Power over the mean at its distance from 0 from which a peak counts."""
COARSEST = 1 / 40
"""Cycles a window's 1/40: slower changes are light and folds, not threads."""
TURN = math.radians(15.0)
SHEAR = math.radians(8.0)
"""How far threads may lie from the picture's axes, and from a right angle."""
USUAL_TURN = math.radians(8.0)
USUAL_SHEAR = math.radians(4.0)
FINEST = 1.05
"""Pixels a thread below which no match is tried."""
NEAR = 1.3
"""Distance, in the window's frequency steps, within which a peak is explained."""
REACH = 2
"""Cycles per thread up to which a peak may be an edge's."""
RATIO = 3.2
"""Most that one pitch is over the other."""


@dataclass(frozen=True, kw_only=True)
class Peak:
    """frequency : (2,) cycles per pixel, x right and y up; clarity : power over its surroundings;
    amplitude : of the wave, over the mean."""

    frequency: Floats
    clarity: float
    amplitude: float


@dataclass(frozen=True, kw_only=True)
class Lattice:
    """Threads in a picture.

    weave : Weave
    frequencies : (2, 2) - columns: threads per pixel of the ends and of the picks, as vectors in
        the picture (x right, y up)
    score : how much better than chance the peaks are explained
    explained : share of the power of all peaks that this lattice explains
    deviation : relative standard deviation of the pitches
    """

    weave: Weave
    frequencies: Floats
    score: float
    explained: float
    deviation: float

    @property
    def pitch(self) -> tuple[float, float]:
        """(ends, picks): pixels from thread to thread."""
        lengths = np.linalg.norm(self.frequencies, axis=0)
        return float(1 / lengths[0]), float(1 / lengths[1])

    @property
    def turn(self) -> float:
        """Angle of the weft to the picture's x, counter-clockwise [rad]."""
        u, v = self.frequencies[:, 0], self.frequencies[:, 1]
        return 0.5 * (math.atan2(u[1], u[0]) + math.atan2(-v[0], v[1]))


def window_of(photograph: Photograph) -> int:
    """Side of the square in the middle whose spectrum is taken, in pixels, even."""
    return int(min(photograph.shape) * 0.75) // 2 * 2


def spectrum(photograph: Photograph) -> tuple[Floats, Floats, float]:
    """((n, n) power, frequency 0 in the middle, (n, n) complex amplitudes, deviation of the
    texture), row 0 at negative y."""
    n = window_of(photograph)
    rows, columns = photograph.shape
    top, left = (rows - n) // 2, (columns - n) // 2
    # The rows of a picture run down, and y runs up.
    flat = relative(photograph, n / 32)[top : top + n, left : left + n][::-1]
    w = np.hanning(n + 1)[:n]
    window = np.outer(w, w)
    wave = np.fft.fftshift(np.fft.fft2(flat * window)) / window.sum()
    return np.abs(wave) ** 2, wave, float(flat.std())


def peaks(photograph: Photograph, most: int = PEAKS) -> list[Peak]:
    """The brightest waves, brightest first; of each and its opposite, one."""
    power, _, _ = spectrum(photograph)
    n = len(power)
    smooth = gaussian_filter(power, 0.7)
    v, u = np.mgrid[-n // 2 : n // 2, -n // 2 : n // 2]
    radius = np.hypot(u, v)
    ring = radius.astype(int)
    floor = np.bincount(ring.ravel(), smooth.ravel()) / np.maximum(np.bincount(ring.ravel()), 1)
    clarity = smooth / np.maximum(floor[ring], 1e-30)
    inside = (radius >= n * COARSEST) & (np.abs(u) < n // 2 - 2) & (np.abs(v) < n // 2 - 2)
    half = (u > 0) | ((u == 0) & (v > 0))
    best = (maximum_filter(smooth, 7) == smooth) & inside & half & (clarity > CLEAR)
    where = np.argwhere(best)
    where = where[np.argsort(-smooth[tuple(where.T)])][:most]
    found = []
    for i, j in where:
        shift = []
        for axis in (1, 0):
            a, b, c = (
                math.log(smooth[i + (k if axis == 0 else 0), j + (k if axis else 0)] + 1e-30)
                for k in (-1, 0, 1)
            )
            curve = a - 2 * b + c
            shift.append(float(np.clip(0.5 * (a - c) / curve, -0.5, 0.5)) if curve < 0 else 0.0)
        frequency = np.array([j - n // 2 + shift[0], i - n // 2 + shift[1]]) / n
        found.append(
            Peak(
                frequency=frequency,
                clarity=float(clarity[i, j]),
                amplitude=2 * math.sqrt(float(power[i - 1 : i + 2, j - 1 : j + 2].sum() / 1.5)),
            )
        )
    return found


def waves_of(weave: Weave) -> tuple[Floats, Floats]:
    """((k, 2) waves in cycles per thread, (k,) their power): what of a weave is bright, the
    strongest first, and the threads' own frequencies last."""
    m, n = weave.ends, weave.picks
    found = np.abs(np.fft.fft2(weave.cells.astype(float))) ** 2
    p, q = np.meshgrid(np.arange(-m, m + 1), np.arange(-n, n + 1), indexing="ij")
    power = found[p % m, q % n] / (m * n) ** 2
    # A cell is a square: its waves fade with their frequency.
    power = power * (np.sinc(p / m) * np.sinc(q / n)) ** 2
    half = (p > 0) | ((p == 0) & (q > 0))
    keep = half & (power > 1e-6)
    waves = np.stack((p[keep] / m, q[keep] / n), axis=1)
    order = np.argsort(-power[keep], kind="stable")[:14]
    strongest = power[keep].max() if keep.any() else 1.0
    waves = np.concatenate((waves[order], [[1.0, 0.0], [0.0, 1.0]]))
    return waves, np.concatenate((power[keep][order], [0.02 * strongest, 0.02 * strongest]))


def match(weave: Weave, found: list[Peak], window: int) -> Lattice | None:
    """The lattice of `weave` that explains the peaks best; None if no two of them fit."""
    if len(found) < 2:
        return None
    waves, power = waves_of(weave)
    frequency = np.stack([peak.frequency for peak in found])
    weight = np.sqrt(np.log(np.array([peak.clarity for peak in found])))
    weight = weight * np.array([peak.amplitude for peak in found]) / found[0].amplitude
    best: Lattice | None = None
    signed = np.concatenate((waves, -waves))
    strength = np.log(np.concatenate((power, power)) / power.max())
    first = range(min(LEADING, len(found)))
    for a, b in [(i, j) for i in first for j in range(i + 1, len(found))]:
        k = np.stack((frequency[a], frequency[b]), axis=1)
        if abs(np.linalg.det(k)) < 4 / window**2:
            continue
        for h, g in np.ndindex(len(signed), len(signed)):
            basis = np.stack((signed[h], signed[g]), axis=1)
            if abs(np.linalg.det(basis)) < 1e-9:
                continue
            made = k @ np.linalg.inv(basis)
            if not _upright(made):
                continue
            score, explained = _score(made, waves, frequency, weight, window)
            # The brightest wave of the picture is likely a bright one of the weave.
            score += float(0.5 * strength[h] + 0.1 * strength[g]) - a - _crooked(made)
            if best is None or score > best.score:
                best = Lattice(
                    weave=weave, frequencies=made, score=score, explained=explained,
                    deviation=0.25 / window / float(np.linalg.norm(made, axis=0).min()),
                )  # fmt: skip
    return None if best is None else refined(best, found, window)


def _upright(made: Floats) -> bool:
    """Whether ends and picks lie near the picture's axes, in pitches that can be."""
    u, v = made[:, 0], made[:, 1]
    if u[0] <= 0 or v[1] <= 0:
        return False
    turns = math.atan2(u[1], u[0]), math.atan2(-v[0], v[1])
    lengths = math.hypot(*u), math.hypot(*v)
    return (
        max(abs(t) for t in turns) < TURN
        and abs(turns[0] - turns[1]) < SHEAR
        and max(lengths) < 1 / FINEST
        and max(lengths) < RATIO * min(lengths)
    )


def _crooked(made: Floats) -> float:
    """Cloth is laid straight more often than not."""
    u, v = made[:, 0], made[:, 1]
    turns = math.atan2(u[1], u[0]), math.atan2(-v[0], v[1])
    return sum((t / USUAL_TURN) ** 2 for t in turns) + ((turns[0] - turns[1]) / USUAL_SHEAR) ** 2


def lattice_points(waves: Floats) -> Floats:
    """(k, 2) the waves and their opposites, and all that differ from them by whole cycles per
    thread, which the edges of threads make."""
    signed = np.concatenate((waves, -waves))
    base = np.unique(np.round(signed - np.floor(np.round(signed, 9)), 9), axis=0)
    whole = np.arange(-REACH - 1, REACH + 1)
    shifts = np.stack(np.meshgrid(whole, whole), axis=-1).reshape(-1, 2)
    return np.unique(np.round((base[:, None] + shifts[None]).reshape(-1, 2), 9), axis=0)


def _score(
    made: Floats, waves: Floats, frequency: Floats, weight: Floats, window: int
) -> tuple[float, float]:
    """(score, share of the weight of the peaks that lie on the lattice)."""
    points = lattice_points(waves) @ made.T
    distance = np.linalg.norm(frequency[:, None] - points[None], axis=2).min(axis=1) * window
    near = np.exp(-0.5 * (distance / NEAR) ** 2)
    inside = np.abs(points).max(axis=1) < 0.5
    # A dense lattice lies near any peak.
    chance = min(1.0, float(inside.sum()) * math.pi * NEAR**2 / window**2 * 2)
    share = float((weight * near).sum() / weight.sum())
    return 10.0 * (share - 4.0 * chance), share


def refined(lattice: Lattice, found: list[Peak], window: int) -> Lattice:
    """`lattice` through all peaks that lie on it, by least squares."""
    points = lattice_points(waves_of(lattice.weave)[0])
    made = lattice.frequencies
    for _ in range(3):
        rows, wanted, weight = [], [], []
        for peak in found:
            distance = np.linalg.norm(points @ made.T - peak.frequency, axis=1) * window
            k = int(distance.argmin())
            if distance[k] < 2 * NEAR and np.abs(points[k]).max() > 0:
                rows.append(points[k])
                wanted.append(peak.frequency)
                weight.append(peak.amplitude)
        h, k_, w = np.array(rows), np.array(wanted), np.array(weight)[:, None]
        if len(h) < 2 or np.linalg.matrix_rank(h, tol=1e-6) < 2:
            return lattice
        made = np.linalg.lstsq(h * w, k_ * w, rcond=None)[0].T
    if not _upright(made):
        return lattice
    return Lattice(
        weave=lattice.weave, frequencies=made, score=lattice.score, explained=lattice.explained,
        deviation=lattice.deviation,
    )  # fmt: skip


def require_lattice(weave: Weave, photograph: Photograph) -> Lattice:
    """The lattice of a weave that is known; FabricError where the photograph does not show it."""
    found = peaks(photograph)
    made = match(weave, found, window_of(photograph))
    if made is None:
        raise FabricError(
            f"'{photograph.name}'",
            f"shows no period that a {weave.name or 'weave'} could have: {len(found)} peaks in its "
            "spectrum; photograph from nearer, or state the pitches with --pitch",
        )
    return made
