"""Name cached kernels by their place in the package, wherever the package lies.

numba names the folder of a kernel by a digest of the absolute path of its source, and a kernel that
is made inside a function by what that function's variables pickle to, which holds absolute paths,
too. A package that moves, or is installed twice, would compile everything again.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from numba.core.caching import CacheImpl, _CacheLocator


class _Locator(_CacheLocator):  # type: ignore[misc]
    """Where the kernels of one source file are cached. `locate_in` makes subclasses."""

    folder: Path
    package: Path
    stamp: str

    def __init__(self, function: Any, relative: Path) -> None:
        self._line = function.__code__.co_firstlineno
        self._path = self.folder / ".".join((self.package.name, *relative.parent.parts))

    def get_cache_path(self) -> str:
        """The folder of the file's kernels."""
        return str(self._path)

    def get_source_stamp(self) -> str:
        """What the sources are: kernels with another stamp are out of date."""
        return self.stamp

    def get_disambiguator(self) -> str:
        """Tells functions of one name apart."""
        return str(self._line)

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Locator | None:
        """The locator of a function; None for those outside the package."""
        path = Path(os.path.realpath(file))
        if not path.is_relative_to(cls.package):
            return None
        found = cls(function, path.relative_to(cls.package))
        try:
            found.ensure_cache_path()
        except OSError:
            return None
        return found


def locate_in(folder: Path, package: Path, stamp: str) -> None:
    """Cache the kernels of `package` in `folder`, by their place in the package.

    stamp : names the state of the package's sources
    """
    ours = type("Locator", (_Locator,), {"folder": folder, "package": package, "stamp": stamp})
    others = [cls for cls in CacheImpl._locator_classes if not issubclass(cls, _Locator)]
    CacheImpl._locator_classes = [ours, *others]
