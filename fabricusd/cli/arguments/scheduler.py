"""The option that hands work to a Dask cluster."""

from __future__ import annotations

import argparse


def add_scheduler(parser: argparse.ArgumentParser) -> None:
    """Add --scheduler."""
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="work on a Dask cluster: tcp://HOST:PORT of its scheduler, or local[:N] for N "
        "processes of this machine (default: threads of this process)",
    )
