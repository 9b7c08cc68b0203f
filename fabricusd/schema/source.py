"""From what a user names to a stage: a file, a file with a prim path, or a preset."""

from __future__ import annotations

import os
from pathlib import Path

from pxr import Sdf, Tf, Usd, UsdUtils

from fabricusd.errors import FabricError
from fabricusd.files import readable_file
from fabricusd.schema.plugin import require_schema

PRESETS = Path(__file__).resolve().parent / "presets"


def preset_names() -> list[str]:
    """Names of the fabrics that come with the package."""
    return sorted(path.stem for path in PRESETS.glob("*.usda"))


def split_source(source: str | os.PathLike[str]) -> tuple[Path, str]:
    """`FILE[:/PRIM]` or a preset's name -> (file, prim path or "")."""
    text = os.fspath(source)
    file, separator, prim = text.rpartition(":/")
    if not separator:
        file, prim = text, ""
    if not file:
        raise FabricError(repr(text), "names no file; it must be a USD file or a preset")
    prim = f"/{prim}" if separator else ""
    if not Path(file).exists() and file in preset_names():
        return PRESETS / f"{file}.usda", prim
    return Path(file), prim


def open_stage(source: str | os.PathLike[str]) -> tuple[Usd.Stage, str]:
    """Open the stage of a file or a preset, with every composition error raised.

    Returns (stage, the name to use in messages). FabricError where the file is missing, empty, no
    USD, or does not compose.
    """
    path, _ = split_source(source)
    if not path.exists():
        near = f"; presets are {', '.join(preset_names())}" if not path.suffix else ""
        raise FabricError(str(path), f"is no file{near}")
    readable_file(path)
    if Sdf.FileFormat.FindByExtension(str(path)) is None:
        raise FabricError(str(path), "is not USD; it must be .usda, .usdc, .usd or .usdz")
    require_schema()
    # USD also prints composition errors as warnings; they are raised below, once.
    silence = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        layer = Sdf.Layer.FindOrOpen(str(path))
        if layer is None:
            raise FabricError(str(path), "is not USD; it cannot be parsed")
        stage = Usd.Stage.Open(layer)
        for used in stage.GetUsedLayers():
            # The process may hold an older reading of the file; edits nobody saved are kept.
            if not used.dirty and not used.anonymous:
                used.Reload()
    except Tf.ErrorException as error:
        raise FabricError(str(path), f"cannot be parsed as USD: {_first_line(error)}") from error
    finally:
        silence.TakeUncoalescedDiagnostics()
        del silence
    errors = stage.GetCompositionErrors()
    if errors:
        raise FabricError(str(path), f"does not compose: {_one_line(str(errors[0]))}")
    return stage, str(path)


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _first_line(error: Tf.ErrorException) -> str:
    """USD's own words without the place in its source code that says them."""
    text = _one_line(str(error))
    _, separator, after = text.partition(" : ")
    return (after if separator else text).strip("'\" ")


def find_fabric(stage: Usd.Stage, file: str, prim_path: str = "") -> Usd.Prim:
    """The Fabric prim at `prim_path`; without one the default prim, or the only one there is."""
    if prim_path:
        if not Sdf.Path.IsValidPathString(prim_path):
            raise FabricError(f"{file}:{prim_path}", "is no prim path")
        prim = stage.GetPrimAtPath(prim_path)
        if not prim:
            raise FabricError(f"{file}:{prim_path}", "is no prim")
        if prim.GetTypeName() != "Fabric":
            kind = prim.GetTypeName() or "an untyped prim"
            raise FabricError(f"{file}:{prim_path}", f"is {kind}; it must be a Fabric")
        return prim
    default = stage.GetDefaultPrim()
    if default and default.GetTypeName() == "Fabric":
        return default
    found = [prim for prim in stage.Traverse() if prim.GetTypeName() == "Fabric"]
    if not found:
        raise FabricError(file, "holds no Fabric prim")
    if len(found) > 1:
        names = ", ".join(f"{file}:{prim.GetPath()}" for prim in found[:8])
        raise FabricError(file, f"holds {len(found)} fabrics; name one of {names}")
    return found[0]
