"""Opens the files that a stage names, including those inside a .usdz package."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pxr import Ar, Sdf

from fabricusd.errors import FabricError


@contextmanager
def asset_file(asset: Sdf.AssetPath) -> Iterator[str]:
    """Yield the name of a file that holds `asset`.

    An asset inside a package is copied to a temporary file, which lives as long as the block.
    Raises `FabricError` where there is no such file; a `FabricError` of the block then names the
    asset.
    """
    path = str(asset.resolvedPath or asset.path)
    if not path:
        raise FabricError("the asset", "names no file; it must name one")
    if not Ar.IsPackageRelativePath(path):
        yield path
        return
    content = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not content:
        raise FabricError(path, "cannot be read: its package holds no such file")
    inside = Ar.SplitPackageRelativePathInner(path)[1]
    with tempfile.TemporaryDirectory(prefix="fabricusd-") as folder:
        copy = Path(folder) / Path(inside).name
        with content as asset_bytes:
            copy.write_bytes(bytes(asset_bytes.GetBuffer()))
        try:
            yield str(copy)
        except FabricError as error:
            raise FabricError(path, error.problem) from error
