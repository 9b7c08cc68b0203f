"""Register the targets that a bake can be written as besides its look; each target is a module.

To add a target, write a module in this folder with the functions below and list it in `TARGETS`.
The command line's options are generated from this file, so it imports no USD.

    check(where, clobber)  raise FabricError, before any work, if the target could not be written
    folder(look, where)    return the folder that the target writes to, so that it can be locked
    write(job, where)      write the target and return its files

`where` is the option's value, None for a switch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fabricusd.fabric import Fabric


@dataclass(frozen=True, kw_only=True)
class Target:
    """A form in which a bake is written on request.

    metavar : placeholder of the option's value, "" for a switch
    module : name of its module in this folder
    """

    name: str
    help: str
    module: str
    metavar: str = ""

    @property
    def functions(self) -> Any:
        """The target's module."""
        return import_module(f"{__name__}.{self.module}")


TARGETS = (
    Target(
        name="usdz", metavar="FILE", module="package", help="also package the look as a USDZ file"
    ),
    Target(name="osl", module="osl", help="also write each fabric's threads as an OSL shader"),
    Target(
        name="u3m", metavar="FOLDER", module="u3m",
        help="also write a U3M swatch of each fabric, for garment CAD",
    ),
)  # fmt: skip

Wanted = Mapping[str, Path | None]
"""Values of `where` by the name of each requested target."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """The input of a target.

    look : the look's layer, which exists already
    fabrics : fabrics of the bake by name
    fitted : whether parameters are fitted; otherwise textures are used unchanged
    clobber : whether existing files may be overwritten
    """

    look: Path
    fabrics: Mapping[str, Fabric]
    fitted: bool
    clobber: bool


def chosen(wanted: Wanted) -> list[tuple[Target, Path | None]]:
    """Return the requested targets in the order of the registry."""
    return [(target, wanted[target.name]) for target in TARGETS if target.name in wanted]
