"""What `--resume` finds in `.bake` may be damaged: it is made again or refused, in one line."""

from __future__ import annotations

import hashlib
import json
import shutil
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fabricusd.bake import bake as module
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.bake.texels.encoding import encoding_from
from fabricusd.bake.work import checkpoint
from fabricusd.bake.work.checkpoint import DIGEST
from fabricusd.bake.work.scratch import Scratch
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.schema import load
from tests.bake.meshes import write_quad
from tests.fuzz import examples

SMALL = Settings(resolution=64, maps=("lay", "height"), file_format="png")
NAME = "square_obj"


def sums(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.glob("[!.]*.png")}


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    """A scene, a fabric, a finished bake's checksums, and the state of one that was stopped when
    its textures were done."""
    folder = tmp_path_factory.mktemp("job")
    scene = write_quad(folder / "square.obj")
    linen = Binding(fabric=load("linen_plain"), threads_per_uv=(16.0, 16.0))
    bake(scene, folder / "whole", SMALL, fabric=linen)
    with pytest.MonkeyPatch.context() as patch:
        # Blocks are kept even when their textures are done, so that both can be damaged.
        patch.setattr(Scratch, "drop", lambda *_: None)
        patch.setattr(module, "write_mesh_layer", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            bake(scene, folder / "stopped", SMALL, fabric=linen)
    return scene, linen, sums(folder / "whole"), folder / "stopped"


@pytest.fixture(autouse=True)
def textures_alone(job, monkeypatch):
    """What is not made of the state is left out or made once, since it takes most of the time."""
    scene, linen, _, _ = job
    known = module._job(scene, SMALL, linen, None, None)
    recipes = module._recipes(known)
    sheets = module._sheets(known.found[0], recipes, known.tiles[0], 64, SMALL.margin)
    for name, value in (
        ("_job", known), ("_recipes", recipes), ("_sheets", sheets), ("refuse_overlaps", None),
        ("write_mesh_layer", None), ("_measure", None), ("save_all", None), ("manifest_of", {}),
        ("write_report", None),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, lambda *_, value=value: value)


def stopped(job, tmp_path) -> Path:
    out = tmp_path / "out"
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(job[3], out)
    return out


def resumed(job, out: Path) -> None:
    """The job goes on, and ends with the bytes of one that was never stopped."""
    scene, linen, truth, _ = job
    bake(scene, out, SMALL, fabric=linen, resume=True)
    assert sums(out) == truth
    assert not list(out.glob(".*"))


@pytest.mark.parametrize("data", [b"\xff\xfe", b"", b"old", b"x" * 10**6])
def test_a_key_that_is_none_is_of_another_job(job, tmp_path, data):
    out = stopped(job, tmp_path)
    (out / ".bake" / "key").write_bytes(data)
    with pytest.raises(FabricError, match="leave --resume out"):
        bake(job[0], out, SMALL, fabric=job[1], resume=True)


def test_state_without_a_key_is_not_trusted(job, tmp_path):
    out = stopped(job, tmp_path)
    (out / ".bake" / "key").unlink()
    for block in (out / ".bake").glob("*/*.block"):
        block.write_bytes(b"of another job")
    for file in out.glob("*.png"):
        file.unlink()
    resumed(job, out)


MARKS = [
    b"\xff\xfe", b"", b"{}", b"[]", b"null", b"1", b"x" * 10**6, b"[" * 3000,
    b'{"sha256": 1, "encoding": 1}', b'{"sha256": "0", "encoding": null}',
]  # fmt: skip


@pytest.mark.parametrize("data", MARKS)
def test_a_texture_whose_mark_is_damaged_is_made_again(job, tmp_path, data):
    out = stopped(job, tmp_path)
    (out / ".bake" / f"{NAME}.height.png.done").write_bytes(data)
    resumed(job, out)


ENCODINGS = [
    None, 1, [], {}, {"transfer": "linear", "scale": 1.0}, {"transfer": 1, "scale": 1, "offset": 0},
    {"transfer": "linear", "scale": float("nan"), "offset": 0.0},
    {"transfer": "linear", "scale": 0, "offset": 0.0},
    {"transfer": "linear", "scale": "1", "offset": 0.0},
    {"transfer": "linear", "scale": 10**400, "offset": 0.0},
    {"transfer": "linear", "scale": 1.0, "offset": True},
    {"transfer": "linear", "scale": 1.0, "offset": 0.0, "more": 1},
]  # fmt: skip


@pytest.mark.parametrize("said", ENCODINGS[1:])
def test_an_encoding_that_is_none_is_refused(said):
    with pytest.raises(ValueError, match=r"must be|has 'transfer'"):
        encoding_from(said)


@pytest.mark.parametrize("said", [said for said in ENCODINGS if said])
def test_a_mark_with_the_right_checksum_and_no_encoding_is_damaged(job, tmp_path, said):
    out = stopped(job, tmp_path)
    mark = out / ".bake" / f"{NAME}.height.png.done"
    mark.write_text(json.dumps({**json.loads(mark.read_text()), "encoding": said}))
    resumed(job, out)


def signed(data: bytes) -> bytes:
    """A block with a right checksum, whatever it holds."""
    return data + hashlib.blake2b(data, digest_size=DIGEST).digest()


@pytest.mark.parametrize("way", ["layout", "values"])
@pytest.mark.parametrize(
    "change",
    [
        lambda data: data[:-1000],
        lambda data: data + b"more",
        lambda data: b"",
        lambda data: signed(b""),
        lambda data: signed(data[: len(data) // 2]),
        lambda data: signed(b"\x7f" * (len(data) - DIGEST)),
        lambda data: signed(b"\x7f" * (2 * 64 * 64 + 300)),
        lambda data: signed(data[: -DIGEST - 4] + b"\xff" * 4),
    ],
)
def test_a_block_that_cannot_be_is_made_again(job, tmp_path, monkeypatch, way, change):
    if way == "values":
        monkeypatch.setattr(
            "fabricusd.bake.work.assemble.checkpoint_of",
            lambda sheet, maps, **_: checkpoint.ValuesCheckpoint(sheet, maps),
        )
    out = stopped(job, tmp_path)
    for mark in (out / ".bake").glob("*.done"):
        mark.unlink()
    for block in (out / ".bake").glob("*/*.block"):
        block.write_bytes(change(block.read_bytes()))
    resumed(job, out)


def test_a_link_or_a_file_in_place_of_the_state_is_refused(job, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "mine").write_text("mine")
    for resume in (False, True):
        out = tmp_path / f"linked{resume}"
        out.mkdir()
        (out / ".bake").symlink_to(outside)
        with pytest.raises(FabricError, match="is a link"):
            bake(job[0], out, SMALL, fabric=job[1], resume=resume)
    assert [p.name for p in outside.iterdir()] == ["mine"]
    out = tmp_path / "file"
    out.mkdir()
    (out / ".bake").write_text("")
    with pytest.raises(FabricError, match="cannot be written"):
        bake(job[0], out, SMALL, fabric=job[1])


@settings(
    max_examples=examples(10, 10_000),
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    deadline=None,
)
@given(st.data())
def test_no_change_of_the_state_is_a_traceback(job, tmp_path, data):
    """Bytes of any file in it changed, cut or added; textures as they should be, or one line."""
    out = stopped(job, tmp_path)
    files = sorted(p for p in (out / ".bake").rglob("*") if p.is_file())
    for _ in range(data.draw(st.integers(1, 3))):
        file = data.draw(st.sampled_from(files))
        held = bytearray(file.read_bytes())
        at = data.draw(st.integers(0, len(held)))
        way = data.draw(st.sampled_from(("put", "cut", "add", "replace")))
        new = data.draw(st.binary(max_size=20))
        if way == "put":
            held[at : at + len(new)] = new
        elif way == "cut":
            del held[at:]
        elif way == "add":
            held[at:at] = new
        else:
            held[:] = new
        file.write_bytes(bytes(held))
    before = {p: p.read_bytes() for p in tmp_path.iterdir() if p.is_file()}
    with suppress(FabricError):
        resumed(job, out)
    assert {p: p.read_bytes() for p in tmp_path.iterdir() if p.is_file()} == before
