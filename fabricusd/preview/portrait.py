"""A picture of a garment for a report: the scene as the preview draws it, before a grey ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Fabric
from fabricusd.preview.lights import Lights
from fabricusd.preview.picture import SAMPLES, shaded
from fabricusd.preview.scenes import shape_of_scene

SIZE = (1024, 576)
"""Width and height [pixels]."""


def portrait(
    source: str, *, fabric: str | Fabric | None = None, units: str | None = None
) -> NDArray[np.uint8]:
    """(h, w, 3) codes of sRGB of the scene in a file, from its camera or from a studio's.

    fabric : worn by what wears none; units : of an .obj or .ply, see `scene.read.read_scene`

    Raises FabricError where the scene cannot be read.
    """
    if isinstance(fabric, str):
        from fabricusd.schema import load

        fabric = load(fabric)
    found = shape_of_scene(source, fabric, None, SIZE[0] / SIZE[1], units)
    picture = shaded(
        found.shape, found.st, found.camera, found.surfaces, "far", SIZE, Lights(),
        SAMPLES["far"], found.material,
    )  # fmt: skip
    return picture.codes()
