"""Write the thread model as an OSL shader, with a fabric's tables as its parameters."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.quadrature import DEFAULT, curve_nodes
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.files import whole_file
from fabricusd.materials.targets import Job

SOURCE = Path(__file__).resolve().parent / "blender" / "fabric_thread.osl"


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
    ]
    text = SOURCE.read_text("utf-8")
    return text.replace("    /* tables */\n", "".join(tables))


def _array(kind: str, name: str, values: Iterable[Any]) -> str:
    # Blender treats an array of length one as a number.
    words = [f"{v:.9g}" if kind == "float" else str(int(v)) for v in values]
    words *= 2 if len(words) == 1 else 1
    return f"    {kind} {name}[{len(words)}] = {{{', '.join(words)}}},\n"
