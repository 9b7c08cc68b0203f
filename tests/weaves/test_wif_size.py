"""Large WIF files: a jacquard comes back, what is too large is refused, both in bounded memory.

Time is in bench/bench_cli.py; here the lines that are read before a refusal are counted.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.fabric import Weave
from fabricusd.weaves import Draft, read_wif, write_wif
from fabricusd.weaves.wif.lines import LARGEST, LONGEST, MOST_LINES, read_sections

READ = """
import json, re, sys
from fabricusd.errors import FabricError
from fabricusd.weaves.wif.read import read_wif
try:
    result = int(read_wif(sys.argv[1]).weave.cells.sum())
except FabricError as error:
    result = str(error)
# Not ru_maxrss, in which a process starts with the peak of the one that started it.
peak = int(re.search(r"VmHWM:\\s*(\\d+) kB", open("/proc/self/status").read())[1]) / 1024
print(json.dumps([peak, result]))
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


def peak_of_reading(path: Path) -> tuple[float, int | str]:
    """(most MiB that a process of its own takes, crossings with warp on top or the refusal)."""
    run = subprocess.run(
        [sys.executable, "-c", READ, str(path)], capture_output=True, text=True, check=True
    )
    megabytes, result = json.loads(run.stdout)
    return megabytes, result


only_linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has /proc")


@only_linux
def test_a_jacquard_of_4096_by_4096_reads_in_500_megabytes(
    jacquard: tuple[Path, Draft],
) -> None:
    path, draft = jacquard
    megabytes, lifted = peak_of_reading(path)
    assert lifted == int(draft.weave.cells.sum())
    assert megabytes < 500  # measured 170


HEAD = "[WIF]\n[WEAVING]\nShafts=2\nTreadles=2\nRising Shed=1\n[TIEUP]\n1=1\n2=2\n"


@only_linux
def test_the_largest_cloth_reads_in_500_megabytes(tmp_path: Path) -> None:
    path = tmp_path / "largest.wif"
    lists = "[THREADING]\n1=1\n2=2\n[TREADLING]\n1=1\n5=2\n"
    path.write_text(f"{HEAD}[WARP]\nThreads=16384\n[WEFT]\nThreads=16384\n{lists}")
    for text in (path.read_text(), path.read_text().replace("Shed=1", "Shed=0")):
        path.write_text(text)
        megabytes, lifted = peak_of_reading(path)
        assert lifted == (2 if "Shed=1" in text else 16384**2 - 2)
        assert megabytes < 500  # measured 380, of which 256 are the cells


def counted(lines: Iterable[str], count: list[int]) -> Iterator[str]:
    for line in lines:
        count[0] += 1
        yield line


def threads(name: str, count: int) -> Iterator[str]:
    yield f"[{name}]\n"
    yield from (f"{k}={k % 2 + 1}\n" for k in range(1, count + 1))


@pytest.mark.parametrize(
    ("counts", "message"),
    [
        ("[WARP]\nThreads=1000000\n", "[WARP] Threads is '1000000'; it must be a whole number"),
        ("[WEFT]\nThreads=1000000\n", "[WEFT] Threads is '1000000'"),
        ("[WEAVING]\nShafts=1000000\n", "[WEAVING] Shafts is '1000000'"),
    ],
)
def test_counts_are_judged_before_the_lines_that_they_count(counts: str, message: str) -> None:
    def lines() -> Iterator[str]:
        yield from (HEAD + counts).splitlines(keepends=True)
        yield from threads("THREADING", 10**6)

    count = [0]
    with pytest.raises(FabricError) as caught:
        read_sections(counted(lines(), count), "d.wif")
    assert message in str(caught.value)
    assert count[0] == len((HEAD + counts).splitlines()) + 1


@only_linux
@pytest.mark.parametrize("kind", ["a million threads, counted last", "lines without end"])
def test_a_file_of_too_many_lines_is_refused_in_500_megabytes(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "long.wif"
    with path.open("w") as stream:
        stream.write(HEAD)
        if kind == "lines without end":
            stream.writelines(["[THREADING]\n", "1=1\n" * (MOST_LINES + 1)])
        else:
            stream.writelines(threads("THREADING", 10**6))
            stream.writelines(threads("TREADLING", 10**6))
            stream.write("[WARP]\nThreads=1000000\n[WEFT]\nThreads=1000000\n")
    megabytes, message = peak_of_reading(path)
    assert message == f"{path} has too many lines for a WIF draft; it must have at most 1000000"
    assert megabytes < 500  # measured 120


def test_a_line_without_an_end_is_refused_where_it_becomes_too_long(tmp_path: Path) -> None:
    path = tmp_path / "wide.wif"
    path.write_text(f"{HEAD}[THREADING]\n1={'1,' * LONGEST}\n")
    with pytest.raises(
        FabricError,
        match="line 10 is too long for a WIF draft; it must have at most 1000000 characters",
    ):
        read_wif(path)


def test_a_file_of_too_many_bytes_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.wif"
    with path.open("wb") as stream:
        stream.write(HEAD.encode())
        stream.truncate(2**40)  # nearly all of it a hole that takes no place on the disk
    with pytest.raises(FabricError, match=f"has {2**40} bytes; .* must have at most {LARGEST}"):
        read_wif(path)


def test_notes_without_end_are_cut_with_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "notes.wif"
    notes = "".join(f"{k}={'x' * 1000}\n" for k in range(1, 2001))
    lists = "[THREADING]\n1=1\n[TREADLING]\n1=1\n"
    path.write_text(f"{HEAD}[WARP]\nThreads=1\n[WEFT]\nThreads=1\n{lists}[NOTES]\n{notes}")
    draft = read_wif(path)
    assert len(draft.notes) == 1000 * 1001 - 1
    assert "[NOTES] has 2000000 characters; those after 1000000 are left out." in draft.warnings
