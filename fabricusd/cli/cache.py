"""`fabricusd cache`."""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from pathlib import Path

EPILOG = """The first line printed is the cache folder; set FABRICUSD_CACHE_DIR to use another.
The cache holds compiled kernels and tables that take long to make. Clearing it costs time and
nothing else.

--pack is for those who build a package: it compiles the kernels of the usual commands, for
processors with AVX2 and with AVX-512, which takes minutes. From fabricusd/kernels/ready/, a package
brings them to machines with the same system, Python and numba.

example:
  fabricusd cache
  fabricusd cache --clear"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to do with the cache."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--clear", action="store_true", help="remove everything in the cache")
    what.add_argument(
        "--pack",
        metavar="FOLDER",
        help="write compiled kernels to a file in this folder (no default)",
    )


def run(options: argparse.Namespace) -> int:
    """List the folder and its entries, remove them, or pack kernels."""
    from fabricusd import cache

    if options.clear:
        removed = cache.clear()
        if not options.quiet:
            size = sum(entry.size for entry in removed)
            words = f"removed {len(removed)} entries, {size / 1e6:.1f} MB"
            print(f"fabricusd: {words}, from {cache.root()}", file=sys.stderr)
        return 0
    if options.pack is not None:
        from fabricusd.kernels.ready import file_name
        from fabricusd.samples.kernels import pack_kernels

        file = Path(options.pack).expanduser() / file_name()
        quiet = (lambda line: None) if options.quiet else partial(print, file=sys.stderr)
        packed = pack_kernels(file, quiet)
        print(f"{file}: {packed} kernels, {file.stat().st_size / 1e6:.1f} MB")
        return 0
    print(cache.root())
    for entry in cache.entries():
        day = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.used))
        print(f"{entry.kind:10} {entry.key:22} {entry.size / 1e6:8.1f} MB  used {day}")
    return 0
