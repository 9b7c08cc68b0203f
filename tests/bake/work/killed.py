"""What a process leaves behind that is killed while it writes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import os, sys
from fabricusd.files import whole_file
writers = [whole_file(path) for path in sys.argv[1:]]
for one in writers:
    one.__enter__().write_bytes(b"half")
os._exit(0)
"""


def leave_half_written(*paths: Path) -> None:
    """Partial files of `paths`, of a process that is gone without having tidied up."""
    root = Path(__file__).resolve().parents[3]
    subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, paths)], check=True,
        env={**os.environ, "PYTHONPATH": str(root)},
    )  # fmt: skip
    assert all(list(path.parent.glob(".*")) for path in paths)
