"""A look in one file: USDZ, whole or for readers of the web."""

from __future__ import annotations

import tempfile
from pathlib import Path

from pxr import Sdf, Usd, UsdShade, UsdUtils

from fabricusd import __version__
from fabricusd.errors import FabricError
from fabricusd.files import require_writable, whole_file
from fabricusd.materials.targets import Job, Note
from fabricusd.materials.targets.flat import flat_garment
from fabricusd.materials.targets.web import simplify


def check(where: Path, clobber: bool) -> None:
    """Raise FabricError if the suffix is not .usdz or the file cannot be written."""
    if where.suffix != ".usdz":
        raise FabricError(f"--usdz '{where}'", f"has the suffix '{where.suffix}'; it must be .usdz")
    require_writable(where, clobber=clobber)


def folder(look: Path, where: Path) -> Path:
    """Return the package's folder."""
    return where.parent


def write(job: Job, where: Path) -> list[Path]:
    """The package alone."""
    write_usdz(job.look, where, clobber=job.clobber, note=job.note)
    return [where]


def write_usdz(
    look: Path, path: Path, *, clobber: bool = True, web: bool = False, note: Note | None = None
) -> None:
    """Package the garment in variant `baked` of a look with its textures, whole or not at all.

    web : UsdPreviewSurface alone, and 8-bit PNG textures, for readers that know no EXR
    note : gets a line about what other readers of the package will not show

    Raises FabricError for another suffix, and where a file that is needed is missing.
    """
    if path.suffix != ".usdz":
        raise FabricError(str(path), "is not the name of a USDZ package; it must end in .usdz")
    missing = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(str(look)))[2]
    if missing:
        raise FabricError(str(look), f"refers to {missing[0]}, which does not exist")
    with tempfile.TemporaryDirectory() as folder, whole_file(path, clobber=clobber) as temporary:
        layer = flat_garment(Usd.Stage.Open(str(look)))
        layer.documentation = f"A baked fabric, packaged by fabricusd {__version__}"
        layer.customLayerData = {"fabricusd": {"version": __version__}}
        if note is not None and _has_tiles(layer):
            note(
                f"{path} has UDIM tiles, which three.js and AR Quick Look do not read; bake with "
                "--fit in place of --udim for them"
            )
        if web:
            simplify(layer, Path(folder))
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


def _has_tiles(layer: Sdf.Layer) -> bool:
    """Whether a texture of the layer is a set of UDIM tiles."""
    stage = Usd.Stage.Open(layer)
    for prim in stage.Traverse():
        given = UsdShade.Shader(prim).GetInput("file") if prim.IsA(UsdShade.Shader) else None
        asset = given.Get() if given else None
        if asset is not None and UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            return True
    return False
