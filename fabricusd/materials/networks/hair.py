"""Approximate the threads by hair: MaterialX's `chiang_hair_bsdf` [Chiang2016].

Weft and warp are two hair scatterers along their own directions, mixed by the area that they cover.
The lobes' variances, the index of refraction and the directions are those of the threads. Threads
do not shadow or mask one another, and the textures provide opacity only. The surface is not fitted.
"""

from __future__ import annotations

import numpy as np

from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.fabric import Thread
from fabricusd.materials.bake_folder import BakedLay
from fabricusd.materials.networks.graph import Builder, Graph, Link, Node, Source, Value
from fabricusd.materials.networks.surfaces import Inputs, Maps, one

AZIMUTHAL = 0.2
"""Scale of the logistic distribution in azimuth [rad]; the thread model has no azimuthal width."""


def hair(maps: Inputs, opaque: bool, lay: BakedLay) -> Graph:
    """Return a surface of two hair scatterers; `lay.fabric` must not be None."""
    fabric = lay.fabric
    assert fabric is not None
    b = Builder()
    area = coverage(fabric).type_area
    along = np.linalg.inv(lay.matrix)
    scatterers = []
    for which, noun in ((WEFT, "weft"), (WARP, "warp")):
        thread = fabric.thread_list[int(np.argmax(area[which]))]
        direction = along[:, which] / np.linalg.norm(along[:, which])
        scatterers.append(_scatterer(b, noun, thread, direction))
    both = float(area.sum())
    share = float(area[WARP].sum()) / both if both > 0 else 0.5
    mixed = b.add(
        "threads", "mix", "BSDF", "ND_mix_bsdf",
        bg=scatterers[0], fg=scatterers[1], mix=one(share),
    )  # fmt: skip
    inputs: dict[str, Source] = {"bsdf": mixed, "thin_walled": Value("boolean", True)}
    if not opaque:
        inputs["opacity"] = Maps(b, maps)("opacity")
    b.nodes["surface"] = Node("surface", "surface", "surfaceshader", "ND_surface", inputs)
    return Graph(tuple(b.nodes.values()), "surface", "out", "mtlx")


def _scatterer(b: Builder, noun: str, thread: Thread, direction: np.ndarray) -> Link:
    space = Value("string", "world")
    t = b.add("mesh_tangent", "tangent", "vector3", "ND_tangent_vector3", space=space)
    s = b.add("mesh_bitangent", "bitangent", "vector3", "ND_bitangent_vector3", space=space)
    sum_ = b.math(
        f"{noun}_sum", "add", "vector3",
        b.math(f"{noun}_u", "multiply", "vector3", t, one(float(direction[0]))),
        b.math(f"{noun}_v", "multiply", "vector3", s, one(float(direction[1]))),
    )  # fmt: skip
    unit: dict[str, Source] = {"in": sum_}
    axis = b.add(f"{noun}_axis", "normalize", "vector3", "ND_normalize_vector3", **unit)
    black = Value("color3", (0.0, 0.0, 0.0))
    inputs: dict[str, Source] = {
        "tint_R": Value("color3", (1.0, 1.0, 1.0)),
        "tint_TT": Value("color3", (1.0, 1.0, 1.0)),
        "tint_TRT": black,
        "ior": one(thread.ior),
        # The thread's widths are those of half the sum of the inclinations; hair lobes use the sum.
        "roughness_R": Value("vector2", ((2.0 * thread.gamma_surface) ** 2, AZIMUTHAL)),
        "roughness_TT": Value("vector2", ((2.0 * thread.gamma_volume) ** 2, 1.0)),
        "roughness_TRT": Value("vector2", ((2.0 * thread.gamma_volume) ** 2, 1.0)),
        "cuticle_angle": one(0.5),
        "absorption_coefficient": Value("vector3", absorption(thread.albedo)),
        "curve_direction": axis,
    }
    return b.add(noun, "chiang_hair_bsdf", "BSDF", "ND_chiang_hair_bsdf", **inputs)


def absorption(color: tuple[float, ...]) -> tuple[float, float, float]:
    """Convert a colour to the absorption of hair of azimuthal roughness 0.3, [Chiang2016] eq. 9."""
    x = 0.3
    scale = 5.969 - 0.215 * x + 2.532 * x**2 - 10.73 * x**3 + 5.574 * x**4 + 0.245 * x**5
    found = (np.log(np.clip(color, 1e-3, 0.99)) / scale) ** 2
    return float(found[0]), float(found[1]), float(found[2])
