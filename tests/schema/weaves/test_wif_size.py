"""A large jacquard as WIF: it comes back, within bounded memory. Time is in bench/bench_cli.py."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fabricusd.fabric import Weave
from fabricusd.schema.weaves import Draft, read_wif, write_wif

READ = """
import json, re, sys
from fabricusd.schema.weaves.wif import read_wif
cells = read_wif(sys.argv[1]).weave.cells
# Not ru_maxrss, in which a process starts with the peak of the one that started it.
peak = int(re.search(r"VmHWM:\\s*(\\d+) kB", open("/proc/self/status").read())[1]) / 1024
print(json.dumps([peak, int(cells.sum())]))
"""


@pytest.fixture(scope="module")
def jacquard(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Draft]:
    """A lift plan of 4096 ends and picks, every second crossing lifted: 40 MB of text."""
    cells = np.random.default_rng(1).random((4096, 4096)) < 0.5
    draft = Draft(weave=Weave(cells, "jacquard"), title="jacquard")
    path = tmp_path_factory.mktemp("size") / "jacquard.wif"
    write_wif(draft, path)
    return path, draft


def test_a_jacquard_of_4096_by_4096_comes_back_as_it_was_written(
    jacquard: tuple[Path, Draft],
) -> None:
    assert read_wif(jacquard[0]) == jacquard[1]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has /proc")
def test_a_jacquard_of_4096_by_4096_reads_in_500_megabytes(
    jacquard: tuple[Path, Draft],
) -> None:
    import json

    path, draft = jacquard
    run = subprocess.run(
        [sys.executable, "-c", READ, str(path)], capture_output=True, text=True, check=True
    )
    megabytes, lifted = json.loads(run.stdout)
    assert lifted == int(draft.weave.cells.sum())
    assert megabytes < 500  # measured 170 to 240
