"""A material of a fabric without a bake: the fabric itself, and its mean as constants for others.

Tools that know the schema take the fabric that the material carries. All others show one of its
surfaces, with the mean colour, roughness and opacity of a repeat.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdShade

from fabricusd.bake.layout.garment import Lay, lay_of
from fabricusd.bake.texels.maps import REGISTRY, Texels
from fabricusd.bake.texels.recipe import recipe
from fabricusd.fabric import Binding, Fabric
from fabricusd.materials.fit.fit import fit
from fabricusd.materials.fit.target import TexelSample
from fabricusd.materials.fit.texels import NEEDED, OPTIONAL
from fabricusd.materials.networks.graph import Value
from fabricusd.materials.networks.look import Look
from fabricusd.materials.networks.surfaces import GRAPHS, MAPS, transmits
from fabricusd.materials.recipes import NEUTRAL, OPAQUE, lit_through, material_recipe
from fabricusd.materials.targets.write_usd import write_material
from fabricusd.schema import write_binding

Looks = Mapping[str, Look]
"""By kind of surface: "preview", "principled" and names of `surfaces.GRAPHS`."""


def write_fabric_material(
    stage: Usd.Stage,
    path: Sdf.Path | str,
    fabric_path: Sdf.Path | str,
    binding: Binding,
    *,
    looks: Looks | None = None,
    surfaces: Sequence[str] = ("openpbr",),
) -> UsdShade.Material:
    """A Material that carries `binding` of the WovenFabric prim at `fabric_path`.

    looks : from `fitted_looks`; None leaves the surfaces at the fabric's own moments
    surfaces : names of `surfaces.GRAPHS`, the first of which is written beside UsdPreviewSurface
    """
    values = mean_values(binding.fabric, lay_of(binding, metres_per_uv=1.0))
    cover = values["opacity"].value
    assert isinstance(cover, float)
    graphs = {name: GRAPHS[name](values, cover > OPAQUE) for name in surfaces}
    kinds = ("preview", "principled", *surfaces)
    known = looks or dict.fromkeys(kinds, Look())
    if transmits(values):
        known = {kind: lit_through(look) for kind, look in known.items()}
    made = material_recipe(Sdf.Path(path).name, graphs, values, known, cover > OPAQUE)
    material = write_material(
        stage, Sdf.Path(path), list(made.graphs), dict(made.parameters), Path()
    )
    write_binding(material.GetPrim(), fabric_path, binding)
    return material


def fitted_looks(fabric: Fabric, surfaces: Sequence[str] = ("openpbr",)) -> Looks:
    """The look of each surface with which the fabric's mean is nearest to the fabric, in about a
    second each."""
    sample = mean_sample(fabric)
    return {kind: fit(kind, sample, fabric).look for kind in ("preview", "principled", *surfaces)}


def mean_sample(fabric: Fabric) -> TexelSample:
    """The one texel that spans a repeat of the fabric."""
    lay = lay_of(Binding(fabric=fabric, threads_per_uv=(1.0, 1.0)), metres_per_uv=1.0)
    texel = {
        name: np.atleast_2d(row) for name, row in _texel(fabric, lay, (*NEEDED, *OPTIONAL)).items()
    }
    smooth = texel["tangent"]
    return TexelSample(
        base=texel["base_color"],
        smooth=texel["roughness_along"][:, 0],
        rough=texel["roughness_across"][:, 0],
        opacity=texel["opacity"][:, 0],
        normal=texel["normal"],
        tangent=np.stack((-smooth[:, 1], smooth[:, 0], smooth[:, 2]), axis=1),
        through=texel["transmission_color"],
        weight=np.ones(1),
    )


def mean_values(fabric: Fabric, lay: Lay) -> dict[str, Value]:
    """One constant for each map of `surfaces.MAPS`: the mean of a repeat."""
    found = {}
    for name, row in _texel(fabric, lay, [n for n in MAPS if n in REGISTRY]).items():
        numbers = tuple(float(x) for x in (0.5 * row + 0.5 if name == "normal" else row))
        found[name] = Value(MAPS[name], numbers if MAPS[name] != "float" else numbers[0])
    return NEUTRAL | found


def _texel(fabric: Fabric, lay: Lay, names: Sequence[str]) -> dict[str, np.ndarray]:
    """(channels,) of each map in the texel that spans whole repeats."""
    made = recipe(fabric)
    texels = Texels.of_moments(made.mean[:, None], made, lay)
    return {name: np.asarray(REGISTRY[name].function(texels), np.float64)[0] for name in names}
