"""Kernels that a package brings along, and that lie where the package does not."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile

import pytest

from fabricusd.kernels import ready
from fabricusd.kernels.cache import PACKAGE, fingerprint
from fabricusd.kernels.internals import use_internals
from fabricusd.kernels.processor import LEVELS
from fabricusd.samples.kernels import levels, pack_kernels

CONTENT = {"a/f-1.py311.nbi": b"index", "a/f-1.py311.1.nbc": b"code", "b/g-2.py311.nbi": b"more"}

needs_internals = pytest.mark.skipif(not use_internals(), reason="numba as it is")


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """A folder of kernels, packed into a file that the package brings."""
    folder = tmp_path / "compiled" / "digest"
    for name, content in CONTENT.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    (folder / ".used").touch()
    brought = tmp_path / "ready"
    brought.mkdir()
    assert ready.pack(folder, brought / ready.file_name()) == 1
    monkeypatch.setattr(ready, "FOLDER", brought)
    monkeypatch.delenv(ready.VARIABLE, raising=False)
    return brought / ready.file_name()


def there(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith(".")
    }


def test_what_was_packed_is_unpacked(kernels, tmp_path):
    (tmp_path / "digest").mkdir()
    ready.unpack_into(tmp_path / "digest")
    assert there(tmp_path / "digest") == CONTENT


def test_kernels_of_other_sources_are_left_alone(kernels, tmp_path):
    (tmp_path / "other").mkdir()
    ready.unpack_into(tmp_path / "other")
    assert there(tmp_path / "other") == {}


def test_kernels_that_are_there_stay(kernels, tmp_path):
    ours = tmp_path / "digest" / "a" / "f-1.py311.nbi"
    ours.parent.mkdir(parents=True)
    ours.write_bytes(b"ours")
    ready.unpack_into(tmp_path / "digest")
    assert there(tmp_path / "digest") == {**CONTENT, "a/f-1.py311.nbi": b"ours"}


def test_they_are_unpacked_once(kernels, tmp_path):
    folder = tmp_path / "digest"
    folder.mkdir()
    ready.unpack_into(folder)
    shutil.rmtree(folder / "a")
    ready.unpack_into(folder)
    assert set(there(folder)) == {"b/g-2.py311.nbi"}


@pytest.mark.parametrize("damage", ["cut off", "a wrong byte"])
def test_a_damaged_file_costs_time_only(kernels, tmp_path, damage):
    content = bytearray(kernels.read_bytes())
    if damage == "cut off":
        del content[100:]
    else:
        # In the first file's own bytes, behind the 30 of its header and its name.
        content[30 + len("digest/a/f-1.py311.1.nbc") + 2] ^= 0xFF
    kernels.write_bytes(content)
    folder = tmp_path / "digest"
    folder.mkdir()
    ready.unpack_into(folder)
    assert set(there(folder).items()) <= set(CONTENT.items())
    assert there(folder) != CONTENT
    assert not list(folder.rglob("*.tmp.*"))


def test_they_can_be_declined(kernels, tmp_path, monkeypatch):
    monkeypatch.setenv(ready.VARIABLE, "0")
    (tmp_path / "digest").mkdir()
    ready.unpack_into(tmp_path / "digest")
    assert there(tmp_path / "digest") == {}


def test_the_same_kernels_make_the_same_file(kernels, tmp_path):
    ready.pack(tmp_path / "compiled" / "digest", tmp_path / "again.zip")
    assert (tmp_path / "again.zip").read_bytes() == kernels.read_bytes()


USE = """
from fabricusd import Thread
from fabricusd.appearance.thread import _density_soa, pdf
print(pdf(Thread(), (0, 0, 1), (0, 0, 1))[0] > 0, *_density_soa.stats.cache_hits.values())
"""


@pytest.fixture
def elsewhere(tmp_path):
    """A copy of the package in another place."""
    shutil.copytree(PACKAGE, tmp_path / "copy" / "fabricusd",
                    ignore=shutil.ignore_patterns("__pycache__", "*.zip"))  # fmt: skip
    return tmp_path / "copy"


def code_of(cache):
    return {path.name for path in (cache / "kernels" / fingerprint()).rglob("*.nbc")}


def run(place, cache, *command):
    # As an installation does it, without the test's settings of numba.
    done = subprocess.run(
        [sys.executable, "-m", "fabricusd", *command], capture_output=True, text=True, cwd=cache,
        env={"PATH": "", "PYTHONPATH": str(place), "FABRICUSD_CACHE_DIR": str(cache)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@needs_internals
def test_a_package_in_another_place_finds_the_kernels(elsewhere, tmp_path):
    def hits(place):
        done = subprocess.run(
            [sys.executable, "-c", USE], capture_output=True, text=True, cwd=tmp_path, check=True,
            env={"PATH": "", "PYTHONPATH": str(place), "FABRICUSD_CACHE_DIR": str(tmp_path / "c"),
                 ready.VARIABLE: "0"},
        )  # fmt: skip
        return done.stdout.split()

    assert hits(PACKAGE.parent) == ["True"]
    assert hits(elsewhere) == ["True", "1"]


@needs_internals
@pytest.mark.exhaustive
def test_a_package_that_brings_its_kernels_compiles_nothing(elsewhere, tmp_path):
    if not levels():
        pytest.skip("a processor without AVX2")
    brought = elsewhere / "fabricusd" / "kernels" / "ready" / ready.file_name()
    brought.parent.mkdir(exist_ok=True)
    assert pack_kernels(brought, commands=("preview linen_plain -o o.png --size 32",)) > 1
    with zipfile.ZipFile(brought) as file:
        packed = {name.rpartition("/")[2] for name in file.namelist() if name.endswith(".nbc")}
    cache = tmp_path / "cache"
    cache.mkdir()
    run(elsewhere, cache, "preview", "linen_plain", "-o", "o.png", "--size", "32")
    assert code_of(cache) == packed
    assert len(levels()) in range(1, len(LEVELS) + 1)
