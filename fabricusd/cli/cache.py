"""`fabricusd cache`."""

from __future__ import annotations

import argparse
import sys
import time

EPILOG = """The first line printed is the cache folder; set FABRICUSD_CACHE_DIR to use another.
The cache holds compiled kernels and tables that take long to make. Clearing it costs time and
nothing else.

example:
  fabricusd cache
  fabricusd cache --clear"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Whether to clear the cache."""
    parser.add_argument("--clear", action="store_true", help="remove everything in the cache")


def run(options: argparse.Namespace) -> int:
    """List the folder and its entries, or remove them."""
    from fabricusd import cache

    if options.clear:
        removed = cache.clear()
        if not options.quiet:
            size = sum(entry.size for entry in removed)
            words = f"removed {len(removed)} entries, {size / 1e6:.1f} MB"
            print(f"fabricusd: {words}, from {cache.root()}", file=sys.stderr)
        return 0
    print(cache.root())
    for entry in cache.entries():
        day = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.used))
        print(f"{entry.kind:10} {entry.key:22} {entry.size / 1e6:8.1f} MB  used {day}")
    return 0
