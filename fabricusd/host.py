"""Which USD a process uses: that of `usd-core`, or one that a host program brings along."""

from __future__ import annotations

import os
import sys
from importlib import metadata
from pathlib import Path

from fabricusd.errors import FabricError

FLOOR = (24, 8)
"""The oldest USD that this runs with: the first with `Stage.GetCompositionErrors`."""

VALIDATORS_FROM = (26, 5)
"""The first USD that runs rules which are written in Python."""


class NoUsd(FabricError, ImportError):
    """USD's Python package `pxr` is missing, or too old."""


MISSING = (
    "USD's Python package pxr is not installed; pip install 'fabricusd[usd]', or run the Python of "
    "a program that brings pxr along"
)


def require_usd() -> None:
    """Raise `NoUsd` where there is no `pxr` to import."""
    try:
        import pxr  # noqa: F401
    except ModuleNotFoundError as error:
        if error.name == "pxr":
            raise NoUsd("", MISSING) from None
        raise


def require_version(version: tuple[int, ...]) -> None:
    """Raise `NoUsd` where USD is older than `FLOOR`; version : as `Usd.GetVersion` returns it."""
    if version[1:] < FLOOR:
        raise NoUsd(
            f"USD {in_words(version[1:])}",
            f"is too old; fabricusd needs USD {in_words(FLOOR)} or newer",
        )


def in_words(version: tuple[int, ...]) -> str:
    """(24, 5) -> "24.5", as usd-core counts."""
    return f"{version[0]}.{version[1]}"


def two_meet() -> str:
    """The line to print where Python finds more than one `pxr`; "" where it finds one or none.

    One of them hides the other. Which one depends on the order of `sys.path`, and libraries of both
    in one process crash.
    """
    folders = pxr_folders()
    if len(folders) < 2:
        return ""
    used, *others = (f"{folder}{_named(folder)}" for folder in folders)
    return (
        f"two USDs meet: pxr is imported from {used}, which hides {', '.join(others)}; "
        "pip uninstall usd-core where a host program brings its own, or take the other off "
        "PYTHONPATH"
    )


def pxr_folders() -> list[Path]:
    """Every `pxr` that Python could import, the one that it does import first."""
    found: dict[Path, None] = {}
    loaded = getattr(sys.modules.get("pxr"), "__file__", None)
    if loaded:
        found[Path(loaded).resolve().parent] = None
    for entry in sys.path:
        folder = Path(entry or os.getcwd(), "pxr")
        if (folder / "__init__.py").is_file():
            found[folder.resolve()] = None
    return list(found)


def _named(folder: Path) -> str:
    """` (usd-core 26.11)` where that package installed a folder."""
    for distribution in metadata.distributions(name="usd-core"):
        if Path(str(distribution.locate_file("pxr"))).resolve() == folder:
            return f" (usd-core {distribution.version})"
    return ""
