"""Write fabrics for Mitsuba 3: one JSON file each, and the plugin that reads them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd import __version__
from fabricusd.appearance.laws import law_of
from fabricusd.appearance.laws.excess import COLUMNS, ROWS
from fabricusd.appearance.laws.visible import COLUMNS as SHARE_COLUMNS
from fabricusd.appearance.laws.visible import HEIGHTS
from fabricusd.appearance.published.columns import NODE_COS, NODE_SIN, NODE_WEIGHT
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering.columns import (
    ALBEDO_B,
    ALBEDO_R,
    IOR_EXCESS,
    ISOTROPIC,
    SURFACE_LOBE,
    VOLUME_LOBE,
)
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.weave.quadrature import DEFAULT
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.files import whole_file, write_json
from fabricusd.materials.targets import Job

PLUGIN = Path(__file__).resolve().parent / "fabricusd_cloth.py"

LAWS = ("masked", "unmasked", "projected", "visible")
"""Surface laws that the plugin has."""

VERSION = 3
"""Of the JSON file."""


def check(where: Path, clobber: bool) -> None:
    """Raise FabricError if the folder cannot be made."""
    if where.exists() and not where.is_dir():
        raise FabricError(f"--mitsuba '{where}'", "is a file; it must be a folder")
    if not where.parent.is_dir():
        raise FabricError(f"--mitsuba '{where}'", f"is in '{where.parent}', which is not a folder")


def folder(look: Path, where: Path) -> Path:
    """Return the folder itself."""
    return where


def write(job: Job, where: Path) -> list[Path]:
    """Write each fabric that the plugin can show, and the plugin; a note names the others."""
    made: list[Path] = []
    try:
        where.mkdir(exist_ok=True)
    except OSError as error:
        raise FabricError(f"--mitsuba '{where}'", f"cannot be made: {error.strerror}") from error
    for name, fabric in job.fabrics.items():
        try:
            content = fabric_content(fabric)
        except FabricError as error:
            job.note(f"no Mitsuba fabric for {name}: {error}")
            continue
        made.append(where / f"{name}.json")
        write_json(made[-1], content)
    if made:
        made.append(where / PLUGIN.name)
        with whole_file(made[-1]) as temporary:
            shutil.copyfile(PLUGIN, temporary)
    return made


def fabric_content(fabric: Fabric) -> dict[str, Any]:
    """Return the tables of a fabric at level `far`, with its mean shadow.

    Raises FabricError for a thread model or a surface law that the plugin has not.
    """
    for name, thread in fabric.threads.items():
        if fabric.model_of(thread) != "microcylinder":
            raise FabricError(
                f"thread '{name}'",
                f"has the model '{fabric.model_of(thread)}'; it must be 'microcylinder'",
            )
    if fabric.surface_law not in LAWS:
        raise FabricError(
            f"fabric '{fabric.name}'",
            f"has the law '{fabric.surface_law}'; it must be one of {', '.join(LAWS)}",
        )
    absolute = law_of(fabric).absolute
    shadow = compile_shadow(fabric, "horizon", precision=np.float64) if absolute else None
    tables: Any = surface_tables(fabric, rule=DEFAULT, shadow=shadow)
    nodes, threads = tables.nodes, tables.threads
    own: dict[str, Any] = {}
    for name in ("precision", "columns"):
        if hasattr(tables, name):
            own[name] = float(getattr(tables, name))
    for name in ("means", "excess", "wide_2", "tall_2", "shares", "gaps"):
        if hasattr(tables, name):
            own[name] = _numbers(getattr(tables, name))
    if "means" in own:
        own["elevations"] = tables.lit_rows
    if "excess" in own:
        own["excess_shape"] = [ROWS, COLUMNS]
    if "shares" in own:
        own["share_shape"] = [HEIGHTS, SHARE_COLUMNS]
    return {
        "fabricusd_cloth": VERSION,
        "made_by": f"fabricusd {__version__}",
        "name": fabric.name,
        "law": fabric.surface_law,
        "gap": float(tables.gap),
        "opaque": bool(fabric.opaque),
        "nodes": [
            {
                "cosine": float(node[NODE_COS]), "sine": float(node[NODE_SIN]),
                "weight": float(node[NODE_WEIGHT]), "thread": int(tables.node_thread[k]),
                "warp": bool(k >= tables.warp_start),
            }
            for k, node in enumerate(nodes)
        ],
        "threads": [
            {
                "albedo": _numbers(row[ALBEDO_R : ALBEDO_B + 1]),
                "ior_excess": float(row[IOR_EXCESS]), "isotropic": float(row[ISOTROPIC]),
                "surface": _numbers(row[SURFACE_LOBE : SURFACE_LOBE + 2]),
                "volume": _numbers(row[VOLUME_LOBE : VOLUME_LOBE + 2]),
            }
            for row in threads
        ],
        **own,
    }  # fmt: skip


def _numbers(values: Any) -> list[float]:
    """Return single-precision numbers, as few digits as they need."""
    return [float(f"{x:.8g}") for x in np.asarray(values, np.float64).ravel()]
