"""The sample garment: a flared skirt of two panels, as it hangs on a figure.

`python samples/make_samples.py --garment fabricusd/samples/skirt.npz` simulates it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

SKIRT = Path(__file__).with_name("skirt.npz")
SEAMS = (30, 91)
"""Columns of UVs before a seam: the next column has the same points."""


def skirt_obj() -> str:
    """The skirt as a Wavefront OBJ in centimetres, +y up, with UVs in metres of cloth.

    The warp runs along v, down the centre front.
    """
    with np.load(SKIRT) as held:
        points, uv = 100 * held["points"].astype(float), held["uv"].astype(float)
    around, down = points.shape[:2]
    columns = len(uv)
    # The column of points of each column of UVs: one on both sides of a seam.
    place = np.arange(columns)
    for seam in SEAMS:
        place[seam + 1 :] -= 1
    place %= around
    lines = [
        "# A flared skirt of two panels, in centimetres; UVs are in metres of cloth.",
        "o Skirt",
    ]
    lines += [f"v {x:.3f} {y:.3f} {z:.3f}" for x, y, z in points.reshape(-1, 3)]
    lines += [f"vt {u:.5f} {v:.5f}" for u, v in uv.reshape(-1, 2)]
    for k in range(columns - 1):
        if k in SEAMS:
            continue
        for j in range(down - 1):
            corners = ((k, j), (k + 1, j), (k + 1, j + 1), (k, j + 1))
            words = [f"{place[a] * down + b + 1}/{a * down + b + 1}" for a, b in corners]
            lines.append("f " + " ".join(words))
    return "\n".join(lines) + "\n"
