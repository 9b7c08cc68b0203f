"""Package a look as a single USDZ file."""

from __future__ import annotations

import tempfile
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom, UsdShade, UsdUtils

from fabricusd.errors import FabricError
from fabricusd.files import require_writable, whole_file
from fabricusd.materials.targets import Job
from fabricusd.schema.access import type_of


def check(where: Path, clobber: bool) -> None:
    """Raise FabricError if the suffix is not .usdz or the file cannot be written."""
    if where.suffix != ".usdz":
        raise FabricError(f"--usdz '{where}'", f"has the suffix '{where.suffix}'; it must be .usdz")
    require_writable(where, clobber=clobber)


def folder(look: Path, where: Path) -> Path:
    """Return the package's folder."""
    return where.parent


def write(job: Job, where: Path) -> list[Path]:
    """Write the package."""
    write_usdz(job.look, where, clobber=job.clobber)
    return [where]


def write_usdz(look: Path, path: Path, *, clobber: bool = True) -> None:
    """Package the variant `baked` of a look with its textures, atomically.

    The stage is flattened into one crate file: many readers of USDZ compose neither references nor
    variants. Raises FabricError for another suffix and if a file that the look needs is missing.
    """
    if path.suffix != ".usdz":
        raise FabricError(str(path), "is not the name of a USDZ package; it must end in .usdz")
    missing = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(str(look)))[2]
    if missing:
        raise FabricError(str(look), f"refers to {missing[0]}, which does not exist")
    stage = Usd.Stage.Open(str(look))
    unused = _unused(stage)
    with tempfile.TemporaryDirectory() as folder, whole_file(path, clobber=clobber) as temporary:
        layer = stage.Flatten()
        flat = Usd.Stage.Open(layer)
        for prim in unused:
            flat.RemovePrim(prim)
        single = Path(folder) / f"{path.stem}.usdc"
        layer.Export(str(single))
        temporary.unlink()
        # Silence USD's warnings about textures that it has just moved into the package.
        silence = UsdUtils.CoalescingDiagnosticDelegate()
        good = UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(single)), str(temporary))
        silence.TakeUncoalescedDiagnostics()
        del silence
        if not good:
            raise FabricError(
                str(path), "cannot be packaged; check that all textures of the look are readable"
            )


def _unused(stage: Usd.Stage) -> list[Sdf.Path]:
    """Return the fabrics and the unbound materials, which only the other variants need."""
    bound = set()
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Imageable) or prim.IsA(UsdGeom.Subset):
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            if material:
                bound.add(material.GetPath())
    return [
        prim.GetPath()
        for prim in stage.Traverse()
        if type_of(prim) == "WovenFabric"
        or (prim.IsA(UsdShade.Material) and prim.GetPath() not in bound)
    ]
