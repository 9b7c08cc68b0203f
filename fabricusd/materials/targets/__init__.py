"""Register the targets that a bake can be written as besides its look; each target is a module.

To add a target, write a module in this folder with the functions below and list it in `TARGETS`.
The command line's options are generated from this file, so it imports no USD.

    check(where, clobber)  raise FabricError, before any work, if the target could not be written
    folder(look, where)    return the folder that the target writes to, so that it can be locked
    write(job, where)      write the target and return its files

`where` is the option's value, None for a switch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fabricusd.bake.layout.garment import Garment
    from fabricusd.fabric import Fabric
    from fabricusd.materials.bake_folder import MapSet
    from fabricusd.materials.targets.layer import Recipes


@dataclass(frozen=True, kw_only=True)
class Target:
    """A form in which a bake is written on request.

    metavar : placeholder of the option's value, "" for a switch
    module : name of its module in this folder
    fits : surfaces that must be fitted for it, whichever surfaces the look has
    """

    name: str
    help: str
    module: str
    metavar: str = ""
    fits: tuple[str, ...] = ()

    @property
    def functions(self) -> Any:
        """The target's module."""
        return import_module(f"{__name__}.{self.module}")


TARGETS = (
    Target(
        name="usdz", metavar="FILE", module="package", help="also package the garment in one file"
    ),
    Target(
        name="usdz-web", metavar="FILE", module="package_web",
        help="also package it for readers that know no EXR (three.js, AR): 8-bit PNG textures",
    ),
    Target(
        name="glb", metavar="FILE", module="gltf.glb", fits=("gltf_pbr",),
        help="also write the garment as binary glTF 2.0, with anisotropy, sheen and variants",
    ),
    Target(
        name="asset", metavar="FOLDER", module="asset",
        help="also an asset of payload, geometry and look, or a colourway more in one",
    ),
    Target(name="osl", module="osl", help="also write each fabric's threads as an OSL shader"),
    Target(
        name="mitsuba", metavar="FOLDER", module="mitsuba.export",
        help="also write each fabric's threads for Mitsuba 3, and the plugin that reads them",
    ),
    Target(
        name="u3m", metavar="FOLDER", module="u3m",
        help="also write a U3M swatch of each fabric, for garment CAD",
    ),
    Target(
        name="swatch", metavar="FOLDER", module="swatch",
        help="also write one seamless tile of each fabric as PNG, for Substance, Unreal, Unity",
    ),
)  # fmt: skip

Note = Callable[[str], None]
"""Gets one line about what is left out."""

Wanted = Mapping[str, Path | None]
"""Values of `where` by the name of each requested target."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """The input of a target.

    look : the layer, which has been written
    garments, recipes : what was baked, and the materials that the look has
    fabrics : those of the bake by their names
    colorway : name of an asset's variant, "" for the fabrics' names
    fitted : whether parameters are sought; otherwise textures stand as they are
    note : gets a line about what the target leaves out
    placed : with a scene, the garments as they are in the scene now, by prim path, in their own UVs
    progress : gets a line before a step that takes seconds
    """

    look: Path
    garments: Sequence[MapSet]
    recipes: Recipes
    fabrics: Mapping[str, Fabric]
    fitted: bool
    clobber: bool
    note: Note
    colorway: str = ""
    placed: Mapping[str, Garment] = field(default_factory=dict)
    progress: Note | None = None


def chosen(wanted: Wanted) -> list[tuple[Target, Path | None]]:
    """Return the requested targets in the order of the registry."""
    return [(target, wanted[target.name]) for target in TARGETS if target.name in wanted]
