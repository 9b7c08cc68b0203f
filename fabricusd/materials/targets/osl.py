"""Write the thread model as an OSL shader, with a fabric's tables as its parameters."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.laws.excess import COLUMNS as AROUND
from fabricusd.appearance.laws.excess import ROWS
from fabricusd.appearance.laws.visible import HEIGHTS, TERMS
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.quadrature import DEFAULT, curve_nodes
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.files import whole_file
from fabricusd.materials.targets import Job

SOURCE = Path(__file__).resolve().parent / "blender" / "fabric_thread.osl"

LAWS = ("masked", "unmasked", "projected", "visible")
"""Surface laws of the shader, by its parameter `law`."""

AZIMUTHS, ELEVATIONS = 16, 17
"""Azimuths and elevations of the shader's mean shadows, and of what is seen: a part of those of
`laws.lit` and `laws.visible`."""


def check(where: None, clobber: bool) -> None:
    """Check nothing: shaders are written beside the look, which is checked already."""


def folder(look: Path, where: None) -> Path:
    """Return the look's folder."""
    return look.parent


def write(job: Job, where: None) -> list[Path]:
    """Write a shader for each fabric beside the look."""
    made = []
    for name, fabric in job.fabrics.items():
        made.append(job.look.with_name(f"{job.look.stem}.{name}.osl"))
        write_osl(fabric, made[-1])
    return made


def write_osl(fabric: Fabric, path: Path) -> None:
    """Write the shader for `fabric` atomically.

    Raises FabricError if a thread's model is not `microcylinder`, the only one in the shader.
    """
    with whole_file(path) as temporary:
        temporary.write_text(osl_source(fabric), "utf-8")


def osl_source(fabric: Fabric) -> str:
    """Return the shader's text, with the tables of `fabric` as defaults of array parameters."""
    for name, thread in fabric.threads.items():
        if fabric.model_of(thread) != "microcylinder":
            raise FabricError(
                f"thread '{name}'",
                f"has the model '{fabric.model_of(thread)}'; it must be 'microcylinder' for the "
                "OSL shader",
            )
    nodes = curve_nodes(fabric, DEFAULT)
    threads = fabric.thread_list
    shadow = None
    if law_of(fabric).absolute:
        shadow = compile_shadow(fabric, "horizon", precision=np.float64)
    law = surface_tables(fabric, rule=DEFAULT, shadow=shadow)
    sets = [int(k >= nodes.warp_start) for k in range(len(nodes.psi0))]
    gap = coverage(fabric).gap
    tables = [
        _array("float", "thread_albedo", [a for t in threads for a in t.albedo]),
        _array("float", "thread_ior", [t.ior for t in threads]),
        _array("float", "thread_isotropic", [t.isotropic for t in threads]),
        _array("float", "thread_gamma_surface", [t.gamma_surface for t in threads]),
        _array("float", "thread_gamma_volume", [t.gamma_volume for t in threads]),
        _array("float", "node_angle", nodes.psi0),
        _array("float", "node_weight", nodes.weight),
        _array("int", "node_thread", nodes.thread),
        _array("int", "node_set", sets),
        f"    int node_count = {len(nodes.psi0)},\n",
        f"    float masking_width = {fabric.masking_width:.9g},\n",
        f"    float gap = {gap:.9g},\n",
        f"    float open = {0.0 if fabric.opaque else gap:.9g},\n",
        f"    int law = {LAWS.index(fabric.surface_law)},\n",
        *_unmasked(law, len(nodes.psi0), fabric.opaque),
    ]
    text = SOURCE.read_text("utf-8")
    return text.replace("    /* tables */\n", "".join(tables))


def _unmasked(law: Any, nodes: int, opaque: bool) -> list[str]:
    """The tables of laws that do not mask, of a single entry each where the law does."""
    means, columns = np.ones(1), 1
    if getattr(law, "columns", 0):
        whole = law.means.reshape(law.columns + 1, law.lit_rows, nodes)
        means = whole[:: law.columns // AZIMUTHS, :: (law.lit_rows - 1) // (ELEVATIONS - 1)]
        columns = AZIMUTHS
    shares = np.zeros(1)
    if getattr(law, "share_columns", 0):
        table = law.shares.reshape(law.share_columns + 1, HEIGHTS, 2 * TERMS)
        shares = table[:: law.share_columns // AZIMUTHS, :: (HEIGHTS - 1) // (ELEVATIONS - 1)]
    shape = {name: getattr(law, name, np.zeros(2)) for name in ("wide_2", "tall_2")}
    excess = np.asarray(getattr(law, "excess", np.ones(1)))
    # Of opaque cloth the shader passes none, and divides by what `excess` holds already.
    gaps = np.zeros(1) if opaque else getattr(law, "gaps", np.zeros(1))
    if gaps.size == 1:
        gaps = np.zeros(ROWS * (AROUND + 1))
    return [
        f"    int columns = {columns},\n",
        f"    int elevations = {ELEVATIONS},\n",
        *(_array("float", name, values) for name, values in shape.items()),
        _array("float", "means", means.ravel(), digits=4),
        _array("float", "shares", shares.ravel(), digits=5),
        f"    int excess_rows = {ROWS},\n",
        f"    int excess_columns = {AROUND},\n",
        _array("float", "excess", excess if excess.size > 1 else np.ones(ROWS * (AROUND + 1))),
        _array("float", "gaps", gaps, digits=5),
    ]


def _array(kind: str, name: str, values: Iterable[Any], digits: int = 9) -> str:
    # Blender treats an array of length one as a number.
    words = [f"{v:.{digits}g}" if kind == "float" else str(int(v)) for v in values]
    words *= 2 if len(words) == 1 else 1
    return f"    {kind} {name}[{len(words)}] = {{{', '.join(words)}}},\n"
