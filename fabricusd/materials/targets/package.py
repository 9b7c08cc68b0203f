"""A look in one file: USDZ."""

from __future__ import annotations

import tempfile
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom, UsdShade, UsdUtils

from fabricusd.errors import FabricError
from fabricusd.files import require_writable, whole_file
from fabricusd.materials.targets import Job
from fabricusd.schema.access import type_of


def check(where: Path, clobber: bool) -> None:
    """Another suffix, and what cannot be written."""
    if where.suffix != ".usdz":
        raise FabricError(f"--usdz '{where}'", "has another suffix; it must be .usdz")
    require_writable(where, clobber=clobber)


def folder(look: Path, where: Path) -> Path:
    """The package's."""
    return where.parent


def write(job: Job, where: Path) -> list[Path]:
    """The package alone."""
    write_usdz(job.look, where, clobber=job.clobber)
    return [where]


def write_usdz(look: Path, path: Path, *, clobber: bool = True) -> None:
    """Package the variant `baked` of a look with its textures, whole or not at all.

    The stage is flattened into one crate: many readers of USDZ compose neither references nor
    variants. Raises FabricError for another suffix, and where a file that is needed is missing.
    """
    if path.suffix != ".usdz":
        raise FabricError(str(path), "is no package's name; it must end in .usdz")
    missing = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(str(look)))[2]
    if missing:
        raise FabricError(str(look), f"refers to {missing[0]}, which is not there")
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
        # USD warns of textures that it has just moved into the package.
        silence = UsdUtils.CoalescingDiagnosticDelegate()
        good = UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(single)), str(temporary))
        silence.TakeUncoalescedDiagnostics()
        del silence
        if not good:
            raise FabricError(str(path), "cannot be packaged; a texture may be in the way")


def _unused(stage: Usd.Stage) -> list[Sdf.Path]:
    """Fabrics, and materials that nothing is bound to: the other variants need them."""
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
