"""One reflectance per view: eq. 3.7 with the width of the thread that its prose has lost.

    f_s = [sum H/(rows D_px)] R cos(8 deg)/(pi L_co cos theta_i)

The sum needs no demosaicing: each colour's sites are summed, and stand for all sites.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.measure.capture.frames import Frame

Floats = NDArray[np.float64]

BACKGROUNDS = ("sides", "zero")

SITES = {
    "RGGB": (0, 1, 1, 2), "BGGR": (2, 1, 1, 0), "GRBG": (1, 0, 2, 1), "GBRG": (1, 2, 0, 1),
}  # fmt: skip
"""Pattern -> channel of the sites (0, 0), (0, 1), (1, 0), (1, 1)."""

THRESHOLD = 3.0
"""Standard deviations of the background below which `zero` sets a pixel to 0."""
MAD = 1.4826
"""Standard deviation of a Gaussian over its median absolute deviation."""


def channel_means(area: Floats, pattern: str) -> Floats:
    """(3,) mean of each colour's sites, in an area of whole 2 x 2 blocks."""
    if pattern == "grey":
        return np.full(3, area.mean())
    sites = np.array([_site_mean(area[s // 2 :: 2, s % 2 :: 2], s // 2) for s in range(4)])
    channel = np.array(SITES[pattern])
    return np.array([sites[channel == c].mean() for c in range(3)])


def _site_mean(plane: Floats, parity: int) -> float:
    """Mean over sites in every other row, from row `parity` on, of what lies in all rows.

    Their middle is half a row off that of all rows. On an uneven thread that would be an error of
    a few tenths of a percent, opposite for red and blue; the slope from end to end takes it back.
    """
    rows = plane.mean(axis=1)
    shift = 0.25 * (rows[-1] - rows[0]) / max(len(rows) - 1, 1)
    return float(rows.mean() + (shift if parity == 0 else -shift))


def thread_sum(radiance: Floats, frame: Frame, pattern: str, background: str) -> Floats:
    """(3,) sum of H over all sites of the thread, per colour as if every site had that colour.

    radiance : (rows, w), the rows of `frame`
    background : "sides" subtracts the mean beside the thread's window; "zero" sets pixels below a
        threshold to 0, as the thesis has it, and sums all
    """
    beside = np.concatenate([radiance[:, : frame.left], radiance[:, frame.right :]], axis=1)
    if background == "zero":
        middle = np.median(beside)
        noise = MAD * np.median(np.abs(beside - middle))
        kept = np.where(radiance > THRESHOLD * noise, radiance, 0.0)
        return channel_means(kept, pattern) * kept.size
    even = beside.shape[1] // 2 * 2
    inside = channel_means(radiance[:, frame.left : frame.right], pattern)
    return (inside - channel_means(beside[:, :even], pattern)) * frame.sites


def imaged_diameter(profile: Floats, background: Floats) -> float:
    """Diameter [pixels] of a thread in focus, from the second moment across it.

    profile : (w,) radiance per column of the window; background : (b,) beside it

    A round thread lit evenly has the profile sqrt(1 - x^2), whose deviation is a quarter of its
    diameter; a pixel adds 1/12. Blur of s pixels makes the result too large by 8 s^2/D.
    """
    light = profile - background.mean()
    x = np.arange(len(light)) + 0.5
    total = light.sum()
    if not total > 0:
        return float("nan")
    middle = (light * x).sum() / total
    reach, diameter = float(len(light)), 0.0
    for _ in range(4):
        near = np.abs(x - middle) <= reach
        total = light[near].sum()
        middle = (light * x)[near].sum() / total
        variance = (light * (x - middle) ** 2)[near].sum() / total - 1.0 / 12.0
        diameter = 4.0 * float(np.sqrt(max(variance, 0.0)))
        # Far from the thread there is only noise, whose leverage is large.
        reach = 0.75 * diameter + 1.0
    return diameter
