"""`--units`, for every command that reads a mesh file."""

from __future__ import annotations

import argparse


def add_units(parser: argparse.ArgumentParser) -> None:
    """What the lengths of a file without a unit are in."""
    parser.add_argument(
        "--units",
        choices=("m", "cm", "mm", "in"),
        help="of the lengths in an .obj or .ply (default: m)",
    )
