"""`--units`, for every command that reads a mesh file."""

from __future__ import annotations

import argparse


def add_units(parser: argparse._ActionsContainer) -> None:
    """Add `--units`, the unit of lengths in a file that does not state one."""
    parser.add_argument(
        "--units",
        choices=("m", "cm", "mm", "in"),
        help="unit of the lengths in an .obj or .ply (default: m)",
    )
