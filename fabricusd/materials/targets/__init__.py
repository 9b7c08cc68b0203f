"""What a bake is turned into besides its look: a registry, one module a target.

To add one: a module in this folder with the functions below, and its line in `TARGETS`. The command
line's options come from here, so this file imports no USD.

    check(where, clobber)  FabricError, before any work, for what could not be written after it
    folder(look, where)    the folder that gets its files, which is locked meanwhile
    write(job, where)      the files that were made

`where` is what the option was given, None for one that is given nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fabricusd.fabric import Fabric
    from fabricusd.materials.bake_folder import MapSet
    from fabricusd.materials.targets.layer import Recipes


@dataclass(frozen=True, kw_only=True)
class Target:
    """A form that a bake is written in when it is asked for.

    metavar : what the option is given, "" for a switch
    module : in this folder
    """

    name: str
    help: str
    module: str
    metavar: str = ""

    @property
    def functions(self) -> Any:
        """Its module."""
        return import_module(f"{__name__}.{self.module}")


TARGETS = (
    Target(
        name="usdz", metavar="FILE", module="package", help="also package the garment in one file"
    ),
    Target(
        name="usdz-web", metavar="FILE", module="package_web",
        help="the same for readers that know no EXR (three.js, AR): 8-bit PNG textures",
    ),
    Target(
        name="asset", metavar="FOLDER", module="asset",
        help="also an asset of payload, geometry and look, or a colourway more in one",
    ),
    Target(name="osl", module="osl", help="also each fabric's threads as an OSL shader"),
    Target(
        name="u3m", metavar="FOLDER", module="u3m",
        help="also a U3M swatch of each fabric, for garment CAD",
    ),
)  # fmt: skip

Note = Callable[[str], None]
"""Gets one line about what is left out."""

Wanted = Mapping[str, Path | None]
"""Names of targets that are asked for -> where."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """What a target is made of.

    look : the layer, which has been written
    garments, recipes : what was baked, and the materials that the look has
    fabrics : those of the bake by their names
    colorway : name of an asset's variant, "" for the fabrics' names
    fitted : whether parameters are sought; otherwise textures stand as they are
    note : gets a line about what the target leaves out
    """

    look: Path
    garments: Sequence[MapSet]
    recipes: Recipes
    fabrics: Mapping[str, Fabric]
    fitted: bool
    clobber: bool
    note: Note
    colorway: str = ""


def chosen(wanted: Wanted) -> list[tuple[Target, Path | None]]:
    """The targets that are asked for, in the order of the registry."""
    return [(target, wanted[target.name]) for target in TARGETS if target.name in wanted]
