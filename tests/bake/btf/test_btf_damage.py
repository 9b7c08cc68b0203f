"""BTF files that are damaged, or that lie about their sizes: one line, before memory is taken."""

from __future__ import annotations

import io
import math
import struct
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings

from fabricusd.bake.btf.factored import (
    FactoredBtf,
    read_atlas,
    read_factored,
    write_atlas,
    write_factored,
)
from fabricusd.bake.btf.factors import Factors
from fabricusd.bake.btf.matrix import ring_directions
from fabricusd.bake.btf.ubo import read_ubo, write_ubo
from fabricusd.errors import FabricError
from fabricusd.images.files import read_exr_layers
from tests import fuzz

HOSTILE = Path(__file__).parents[2] / "cases" / "hostile"

DIRECTIONS = ring_directions(((0.0, 1), (40.0, 3)))
SIZE = (2, 3)


def factors(joint: bool, rank: int = 2) -> Factors:
    rng = np.random.default_rng(0)
    groups = 1 if joint else 3
    rows = [rng.random((16, 3 // groups, rank), np.float32) for _ in range(groups)]
    columns = [rng.random((6, rank), np.float32) for _ in range(groups)]
    return Factors(rows=tuple(rows), columns=tuple(columns), delta_e=0.5)


def one() -> FactoredBtf:
    return FactoredBtf(directions=DIRECTIONS, factors=factors(True), size=SIZE, per_thread=1)


def ubo_bytes(folder: Path, joint: bool) -> bytes:
    made = factors(joint)
    btf = SimpleNamespace(
        directions=DIRECTIONS,
        size=SIZE,
        per_thread=1,
        fabric=SimpleNamespace(warp=SimpleNamespace(pitch=1e-3)),
    )
    write_ubo(folder / "whole.btf", btf, made)  # type: ignore[arg-type]
    return (folder / "whole.btf").read_bytes()


def npz_bytes(**changes: np.ndarray) -> bytes:
    whole = {
        "directions": DIRECTIONS,
        "rows": factors(True).rows[0].astype(np.float16),
        "columns": factors(True).columns[0].astype(np.float16),
        "size": np.array(SIZE),
        "per_thread": np.array(1),
        "delta_e": np.array(0.5),
    }
    stream = io.BytesIO()
    np.savez_compressed(stream, **{k: v for k, v in (whole | changes).items() if v is not None})
    return stream.getvalue()


def refusal(read, path: Path, data: bytes | None = None) -> str:
    """What is said of a file, in 500 MB and a second; it must begin with the file's name."""
    if data is not None:
        path.write_bytes(data)
    message = fuzz.refusal(read, path)
    assert message.startswith(str(path))
    return message


def test_sizes_that_a_file_cannot_have_are_refused_before_memory_is_taken(tmp_path: Path) -> None:
    assert "must have" in refusal(read_ubo, HOSTILE / "ubo_memory.btf")


@pytest.mark.parametrize("joint", [True, False])
def test_every_count_of_a_btf_file_is_compared_with_its_length(tmp_path: Path, joint: bool) -> None:
    """Each 4 bytes of the file by huge numbers in turn: refused, or not a count at all."""
    good = ubo_bytes(tmp_path, joint)
    path = tmp_path / "a.btf"
    assert fuzz.refusal(read_ubo, tmp_path / "whole.btf") == ""
    refused = 0
    for at in range(len(good) - 3):
        for number in (0, 2**31, 2**32 - 1):
            path.write_bytes(good[:at] + struct.pack("<I", number) + good[at + 4 :])
            refused += bool(fuzz.refusal(read_ubo, path))
    assert refused > 100


@pytest.mark.parametrize("joint", [True, False])
def test_a_btf_file_of_any_other_length_is_refused(tmp_path: Path, joint: bool) -> None:
    good = ubo_bytes(tmp_path, joint)
    for end in range(1, len(good)):
        assert refusal(read_ubo, tmp_path / "a.btf", good[:end])
    message = refusal(read_ubo, tmp_path / "a.btf", good + b"\0")
    assert "the number of bytes after the last matrix is 1; it must be 0" in message


@pytest.mark.parametrize("joint", [True, False])
def test_nan_in_a_btf_file_is_counted(tmp_path: Path, joint: bool) -> None:
    good = ubo_bytes(tmp_path, joint)
    nan = np.array([math.nan] * 3, "<f2").tobytes()
    message = refusal(read_ubo, tmp_path / "a.btf", good[:-6] + nan)
    assert "has 3 of 12 factors of texels that are NaN or infinite" in message
    message = refusal(read_ubo, tmp_path / "b.btf", good.replace(
        np.float32(math.radians(40)).tobytes(), np.float32(math.nan).tobytes()))  # fmt: skip
    assert "angles that are NaN" in message


def zip_of(name: str, data: bytes, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO(npz_bytes(rows=None))
    with zipfile.ZipFile(stream, "a", method) as archive:
        archive.writestr(name, data)
    return stream.getvalue()


def npy(header: str, data: bytes = b"", version: bytes = b"\1\0") -> bytes:
    text = header.encode() + b"\n"
    return b"\x93NUMPY" + version + struct.pack("<H", len(text)) + text + data


def by_method(method: int, flags: int = 0) -> bytes:
    """The archive, whose directory says that its arrays are compressed by another method."""
    data = bytearray(npz_bytes())
    for mark, at in ((b"PK\1\2", 8), (b"PK\3\4", 6)):
        begin = -1
        while (begin := data.find(mark, begin + 1)) >= 0:
            data[begin + at : begin + at + 4] = struct.pack("<HH", flags, method)
    return bytes(data)


OBJECTS = np.array([{"a": 1}], dtype=object)
HEADER = "{'descr': '<f2', 'fortran_order': False, 'shape': %s}"
BROKEN = {
    "no zip": (b"hello" * 20, "is not a factored BTF or is damaged"),
    "an array alone": (npy(HEADER % "(9,)", bytes(18)), "is not a factored BTF or is damaged"),
    "an array that asks for all": (npy(HEADER % f"({2**40},)"), "is not a factored BTF or is"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(50), "is not a factored BTF or is damaged"),
    "cut off": (npz_bytes()[:-40], "is not a factored BTF or is damaged"),
    "an array is missing": (npz_bytes(columns=None), "has no array 'columns'; a factored BTF must"),
    "no array is in it": (b"PK\5\6" + bytes(18), "has no array 'directions'"),
    "Python objects": (npz_bytes(size=OBJECTS), "'size' holds Python objects"),
    "text": (npz_bytes(size=np.array(["2", "3"])), "'size' holds values of type <U1"),
    "complex numbers": (npz_bytes(rows=np.zeros((16, 3, 2), complex)), "values of type complex128"),
    "a number for a table": (npz_bytes(rows=np.array(1.0)), "'rows' has shape (); it must have 3"),
    "another size": (npz_bytes(size=np.array((2, 4))), "columns for 6 texels; it must have 8"),
    "negative size": (npz_bytes(size=np.array((-2, -3))), "is -3 x -2 texels"),
    "three sizes": (npz_bytes(size=np.array((2, 3, 1))), "has the size [2, 3, 1]; it must be two"),
    "sizes that are no numbers": (npz_bytes(size=np.array((math.nan, 3))), "has the size [nan, 3"),
    "rows of other directions": (
        npz_bytes(rows=np.zeros((15, 3, 2), np.float16)),
        "has rows of shape (15, 3, 2) beside columns of (6, 2); rows must be (16, 3, r)",
    ),
    "ranks that differ": (npz_bytes(rows=np.zeros((16, 3, 5))), "has rows of shape (16, 3, 5)"),
    "no rank": (
        npz_bytes(rows=np.zeros((16, 3, 0)), columns=np.zeros((6, 0))),
        "has rows of shape (16, 3, 0)",
    ),
    "no directions": (npz_bytes(directions=np.zeros((0, 3))), "directions of shape (0, 3)"),
    "directions in the plane": (npz_bytes(directions=DIRECTIONS[:, :2]), "of shape (4, 2)"),
    "a direction below the cloth": (npz_bytes(directions=-DIRECTIONS), "direction 0 is [-0.0, -0"),
    "a direction that is none": (npz_bytes(directions=DIRECTIONS * math.nan), "12 of 12 direc"),
    "NaN in rows": (npz_bytes(rows=np.full((16, 3, 2), math.nan)), "has 96 of 96 factors of dir"),
    "infinity in columns": (npz_bytes(columns=np.full((6, 2), 1e300)), "has 12 of 12 factors of"),
    "NaN for the error": (npz_bytes(delta_e=np.array(math.nan)), "has the error nan; it must be"),
    "no texel a thread": (npz_bytes(per_thread=np.array(0)), "has 0 texels per thread; it must"),
    "endless texels a thread": (npz_bytes(per_thread=np.array(math.inf)), "has inf texels per t"),
    "a bomb": (zip_of("rows.npy", bytes(300_000_000)), "; a factored BTF of its size may have at"),
    "a shape beyond the data": (
        zip_of("rows.npy", npy(HEADER % f"({2**31}, {2**31}, 4)", bytes(10))),
        "but 10 bytes of data",
    ),
    "a negative shape": (zip_of("rows.npy", npy(HEADER % "(-1, 3, 2)")), "'rows' has shape (-1, 3"),
    "a header that is code": (
        zip_of("rows.npy", npy("__import__('os').abort()")),
        "is not a factored BTF or is damaged: ValueError",
    ),
    "a header without an end": (zip_of("rows.npy", npy("{" * 9000)), "is not a factored BTF or is"),
    "another version": (
        zip_of("rows.npy", npy(HEADER % "(1,)", b"", b"\3\0")),
        "'rows' has the .npy version (3, 0); it must be 1.0 or 2.0",
    ),
    "stored by another method": (by_method(99), "or is damaged: NotImplementedError"),
    "encrypted": (by_method(8, flags=1), "or is damaged: RuntimeError"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_archive_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    data, message = BROKEN[case]
    assert message in refusal(read_factored, tmp_path / "a.npz", data)


@pytest.mark.parametrize("file", ["notzip.factored.npz", "zlib.factored.npz"])
def test_archives_that_ended_in_tracebacks_are_refused(file: str) -> None:
    assert "is not a factored BTF or is damaged" in refusal(read_factored, HOSTILE / file)


def test_the_archive_that_the_broken_ones_come_from_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(npz_bytes())
    back = read_factored(tmp_path / "a.npz")
    assert back.size == SIZE
    assert back.per_thread == 1
    write_factored(tmp_path / "b.npz", back)
    assert read_factored(tmp_path / "b.npz").factors.delta_e == 0.5


def test_an_atlas_that_lost_a_part_is_refused(tmp_path: Path) -> None:
    stem = tmp_path / "a"
    write_atlas(stem, one())
    assert read_atlas(stem).size == SIZE
    weights, components = (Path(f"{stem}.{n}.exr") for n in ("weights", "components"))
    good = weights.read_bytes()
    weights.write_bytes(good[: len(good) // 2])
    assert "cannot be read as a picture" in refusal(lambda _: read_atlas(stem), weights)
    weights.write_bytes(components.read_bytes())
    assert "is not an atlas of a BTF" in refusal(lambda _: read_atlas(stem), weights)
    weights.write_bytes(good)
    components.write_bytes(good)
    with pytest.raises(FabricError):
        read_atlas(stem)


def test_directions_that_cannot_be_interpolated_are_refused_when_they_are_asked() -> None:
    line = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [-0.6, 0.0, 0.8], [0.8, 0.0, 0.6]])
    btf = FactoredBtf(directions=line, factors=factors(True), size=SIZE, per_thread=1)
    with pytest.raises(FabricError, match="directions lie on one line"):
        btf.evaluate([[0.0, 0.0]], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("seeds")
    write_atlas(folder / "a", one())
    return {
        "joint": ubo_bytes(folder, True),
        "channels": ubo_bytes(folder, False),
        "npz": npz_bytes(),
        "stored npz": stored(npz_bytes()),
        "exr": (folder / "a.weights.exr").read_bytes(),
    }


def stored(data: bytes) -> bytes:
    """The archive without compression, so that mutations reach headers and numbers."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(stream, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    return stream.getvalue()


@pytest.mark.parametrize("kind", ["joint", "channels"])
def test_a_mutated_btf_file_is_read_or_refused(
    tmp_path: Path, seeds: dict[str, bytes], kind: str
) -> None:
    path = tmp_path / "a.btf"

    @settings(max_examples=fuzz.examples(150, 50_000))
    @given(fuzz.mutated(seeds[kind], fuzz.WORDS))
    def try_one(data: bytes) -> None:
        path.write_bytes(data)
        fuzz.refusal(read_ubo, path)

    try_one()


@pytest.mark.parametrize("kind", ["npz", "stored npz"])
def test_a_mutated_archive_is_read_or_refused(
    tmp_path: Path, seeds: dict[str, bytes], kind: str
) -> None:
    path = tmp_path / "a.npz"

    @settings(max_examples=fuzz.examples(150, 50_000))
    @given(fuzz.mutated(seeds[kind]))
    def try_one(data: bytes) -> None:
        path.write_bytes(data)
        fuzz.refusal(read_factored, path)

    try_one()


def test_a_mutated_picture_of_layers_is_read_or_refused(
    tmp_path: Path, seeds: dict[str, bytes]
) -> None:
    path = tmp_path / "a.exr"

    @settings(max_examples=fuzz.examples(100, 20_000))
    @given(fuzz.mutated(seeds["exr"]))
    def try_one(data: bytes) -> None:
        path.write_bytes(data)
        fuzz.refusal(read_exr_layers, path)

    try_one()


def test_a_signalling_nan_at_any_place_is_counted_as_any_other(
    tmp_path: Path, seeds: dict[str, bytes]
) -> None:
    path, data, said = tmp_path / "a.btf", seeds["channels"], []
    for place in range(6, len(data) - 4, 3):
        path.write_bytes(data[:place] + b"\x01\x00\xa0\x7f" + data[place + 4 :])
        said.append(fuzz.refusal(read_ubo, path) or "")
    assert sum("angles" in line for line in said) > 1, set(said)
