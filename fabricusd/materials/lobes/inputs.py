"""A mixture in the form of Cycles as inputs of the material, from which Blender's add-on builds it.

A USD network cannot hold it: Blender reads UsdPreviewSurface alone, and MaterialX's lobes mask
otherwise. Pairs stay pairs, so that one edit of a tilt moves both lobes.

    cycles:fabric token           name of the fabric
    cycles:weft, cycles:warp float2    directions of the threads in texture space
    cycles:diffuse, cycles:sheen ...   fields of `Mixture`
    cycles:lobe0:along token      "weft" or "warp"
    cycles:lobe0:tilt ...         fields of `Lobe`
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.lobes.mixture import CYCLES, OF_MATERIALX, Lobe, Mixture
from fabricusd.materials.networks.graph import Value

Floats = NDArray[np.float64]

PREFIX = "cycles:"

NOUNS = ("weft", "warp")

_KINDS = {"bool": "boolean", "float": "float", "tuple[float, float, float]": "color3"}
"""Types of inputs by the types of fields."""


def inputs(mixture: Mixture, fabric: str, matrix: Floats) -> dict[str, Value]:
    """Return the inputs of a material.

    fabric : the fabric's name
    matrix : (2, 2) from the texture coordinates to threads, as in `BakedLay`
    """
    assert mixture.form == CYCLES
    along = np.linalg.inv(matrix)
    along = along / np.linalg.norm(along, axis=0)
    found = {"fabric": Value("token", fabric)}
    for k, noun in enumerate(NOUNS):
        found[noun] = Value("vector2", (float(along[0, k]), float(along[1, k])))
    found |= _values(mixture, "")
    if mixture.view:
        found["view"] = Value("floats", mixture.view)
    for number, lobe in enumerate(mixture.lobes):
        found[f"lobe{number}:along"] = Value("token", NOUNS[lobe.along])
        found |= _values(lobe, f"lobe{number}:")
    return {PREFIX + name: value for name, value in found.items()}


def _values(one: Mixture | Lobe, prefix: str) -> dict[str, Value]:
    return {
        prefix + field.name: Value(_KINDS[str(field.type)], getattr(one, field.name))
        for field in fields(one)
        if str(field.type) in _KINDS and field.name not in OF_MATERIALX
    }
