"""`fabricusd plugin-path`."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import fabricusd

EPILOG = """example:
  PXR_PLUGINPATH_NAME="$(fabricusd plugin-path)" usdview garment.usda
  PXR_PLUGINPATH_NAME="$(fabricusd plugin-path --validators)" python check_assets.py"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Whether to add the folder of the validators."""
    parser.add_argument(
        "--validators",
        action="store_true",
        help="add the folder of the rules, for programs of USD 26.5 or newer whose Python can "
        "import fabricusd",
    )


def run(options: argparse.Namespace) -> int:
    """Print the folder, or both folders."""
    # Not through fabricusd.schema, which would load USD just to print a path.
    folder = Path(fabricusd.__file__).resolve().parent / "schema" / "plugin"
    folders = [folder, folder / "validators"] if options.validators else [folder]
    print(os.pathsep.join(map(str, folders)))
    return 0
