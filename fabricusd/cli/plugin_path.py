"""`fabricusd plugin-path`."""

from __future__ import annotations

import argparse
from pathlib import Path

import fabricusd

EPILOG = 'example:\n  PXR_PLUGINPATH_NAME="$(fabricusd plugin-path)" usdview garment.usda'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments of its own."""


def run(_options: argparse.Namespace) -> int:
    """Print the folder."""
    # Not by way of fabricusd.schema: that would load USD to print a path.
    print(Path(fabricusd.__file__).resolve().parent / "schema" / "plugin")
    return 0
