"""Which USD attribute holds which field of the dataclasses, and in which unit.

The one table that reading, writing and checking share. Units are converted here and nowhere else:
a value in the file times `scale` is the value in SI units or radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any

from fabricusd.fabric import Binding, Fabric, Thread, ThreadSet
from fabricusd.sides import Sides

DEGREE = math.pi / 180.0
MILLIMETRE = 1e-3
PER_CENTIMETRE = 100.0
TEX = 1e-6


@dataclass(frozen=True)
class Attribute:
    """One USD attribute.

    name : str - full property name
    type_name : str - Sdf value type
    owner, field : the dataclass and its field that it holds
    scale : float - SI value = file value x scale
    unit : str - of the file value, for messages
    sentinel : float or None - the file value that means None
    """

    name: str
    type_name: str
    owner: type
    field: str
    scale: float = 1.0
    unit: str = ""
    sentinel: float | None = None

    @property
    def is_color(self) -> bool:
        """Whether it holds a colour, which has a color space."""
        return self.type_name.startswith("color")

    @property
    def limits(self) -> Mapping[str, Any]:
        """The field's bounds, in SI; empty where it has none."""
        for f in fields(self.owner):
            if f.name == self.field:
                return f.metadata
        return MappingProxyType({})


THREAD = (
    Attribute("thread:albedo", "color3d", Thread, "albedo"),
    Attribute("thread:ior", "double", Thread, "ior"),
    Attribute("thread:isotropic", "double", Thread, "isotropic"),
    Attribute("thread:gammaSurface", "double", Thread, "gamma_surface", DEGREE, "degrees"),
    Attribute("thread:gammaVolume", "double", Thread, "gamma_volume", DEGREE, "degrees"),
    Attribute("thread:surfaceGain", "double", Thread, "surface_gain"),
    Attribute("thread:thickness", "double", Thread, "thickness", MILLIMETRE, "mm"),
    Attribute("thread:linearDensity", "double", Thread, "linear_density", TEX, "tex"),
    Attribute("thread:color", "color3d", Thread, "color"),
    Attribute("thread:targetColor", "color3d", Thread, "target_color"),
    Attribute("thread:unevenness:cv", "double", Thread, "unevenness_cv"),
    Attribute("thread:unevenness:length", "double", Thread, "unevenness_length", MILLIMETRE, "mm"),
    Attribute("thread:unevenness:count", "double", Thread, "unevenness_count"),
    Attribute("thread:unevenness:shade", "double", Thread, "unevenness_shade"),
    Attribute("thread:slub:amount", "double", Thread, "slub_amount"),
    Attribute("thread:slub:length", "double", Thread, "slub_length", MILLIMETRE, "mm"),
    Attribute("thread:slub:spacing", "double", Thread, "slub_spacing", MILLIMETRE, "mm"),
    Attribute("thread:plies", "int", Thread, "plies"),
    Attribute("thread:twist", "double", Thread, "twist", unit="turns/m"),
    Attribute("thread:hairiness", "double", Thread, "hairiness"),
)
"""Numbers of a WovenThread; its curve, its model and the tokens of its target are read apart."""

TARGET_BASIS = Attribute("thread:targetColor:basis", "token", Thread, "target_basis")

FABRIC = (
    Attribute("fabric:maskingWidth", "double", Fabric, "masking_width", DEGREE, "degrees"),
    Attribute("fabric:unevenness:seed", "int", Fabric, "unevenness_seed"),
)
"""Numbers of a WovenFabric; the sets, the weave, tokens and relationships are read apart."""

SIDES = tuple(
    Attribute(f"fabric:sides:{name}", "double[]", Sides, name)
    for name in ("gap", "surface", "reflected", "transmitted", "forward")
)
"""Where the light of a WovenFabric goes; an empty array states nothing."""


def thread_set(which: str) -> tuple[Attribute, Attribute]:
    """Density and coverage of `which`, "warp" or "weft"."""
    return (
        Attribute(
            f"fabric:{which}:density", "double", ThreadSet, "density", PER_CENTIMETRE, "threads/cm"
        ),
        Attribute(f"fabric:{which}:coverage", "double", ThreadSet, "coverage", sentinel=-1.0),
    )


BINDING = (
    Attribute(
        "fabric:binding:millimetersPerUnit", "double", Binding, "metres_per_uv", MILLIMETRE, "mm"
    ),
    Attribute("fabric:binding:threadsPerUnit", "double2", Binding, "threads_per_uv"),
    Attribute("fabric:binding:rotation", "double", Binding, "rotation", DEGREE, "degrees"),
    Attribute("fabric:binding:offset", "double2", Binding, "offset"),
)
"""Numbers of a WovenBindingAPI."""


def every_attribute() -> tuple[Attribute, ...]:
    """All of them, of the three schemas."""
    return (*THREAD, *FABRIC, *SIDES, *thread_set("warp"), *thread_set("weft"), *BINDING)


def to_si(value: Any, attribute: Attribute) -> Any:
    """A file value in SI units; a tuple where the file holds a vector."""
    if attribute.sentinel is not None and value == attribute.sentinel:
        return None
    if hasattr(value, "__len__"):
        return tuple(float(x) * attribute.scale for x in value)
    if attribute.type_name == "int":
        return int(value)
    return float(value) * attribute.scale


def from_si(value: Any, attribute: Attribute) -> Any:
    """The shortest file value that `to_si` turns back into `value`, where there is one."""
    if value is None:
        return attribute.sentinel
    if isinstance(value, tuple):
        return tuple(unscale(x, attribute.scale) for x in value)
    return unscale(value, attribute.scale)


def unscale(value: float, scale: float) -> float:
    """The shortest x with `x * scale == value`; the nearest one where none is exact.

    12 degrees becomes 0.20943951023931956 rad, and dividing again gives 12.000000000000002: what
    an artist typed has to come back as typed.
    """
    if scale == 1.0 or value == 0.0:
        return value
    nearest = value / scale
    for digits in range(1, 18):
        short = float(f"{nearest:.{digits}g}")
        if short * scale == value:
            return short
    for neighbour in (math.nextafter(nearest, math.inf), math.nextafter(nearest, -math.inf)):
        if neighbour * scale == value:
            return neighbour
    return nearest
