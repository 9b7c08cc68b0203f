"""Damaged files of the kernel cache are compiled again."""

from __future__ import annotations

import importlib.util
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import fabricusd.kernels.start  # noqa: F401
from fabricusd.kernels.internals import use_internals

pytestmark = pytest.mark.skipif(not use_internals(), reason="this run uses numba as it is")

KERNEL = """
from numba import njit

@njit(cache=True)
def kernel(x):
    return 2 * x + 1
"""


def fresh(folder):
    """The kernel as a new process finds it: nothing in memory, what there is on disk."""
    spec = importlib.util.spec_from_file_location("one_kernel", folder / "one_kernel.py")
    module = importlib.util.module_from_spec(spec)
    # numba pickles the function by the name of its module.
    sys.modules["one_kernel"] = module
    spec.loader.exec_module(module)
    return module.kernel


@pytest.fixture(params=["beside the source", "in NUMBA_CACHE_DIR"])
def compiled(request, tmp_path, monkeypatch):
    """(folder of the source, folder of the cache) of a kernel that has been compiled."""
    where = str(tmp_path / "cache") if request.param == "in NUMBA_CACHE_DIR" else ""
    monkeypatch.setattr(numba.config, "CACHE_DIR", where)
    monkeypatch.delitem(sys.modules, "one_kernel", raising=False)
    (tmp_path / "one_kernel.py").write_text(KERNEL)
    kernel = fresh(tmp_path)
    assert kernel(3) == 7
    yield tmp_path, Path(kernel.stats.cache_path)
    sys.modules.pop("one_kernel", None)


def flipped(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


DAMAGE = {
    "one bit": flipped,
    "empty": lambda data: b"",
    "cut": lambda data: data[: len(data) // 2],
    "cut a byte before its checksum": lambda data: data[:-49],
    "garbage": lambda data: b"\xde\xad\xbe\xef" * 100,
    "zeros": lambda data: bytes(len(data)),
    "text": lambda data: b"<html>not found</html>",
    "another object": lambda data: pickle.dumps([1, 2, 3]),
    "of another numba": lambda data: pickle.dumps("0.1.0") + b"whatever it wrote",
}


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_file_is_compiled_again_and_whole_from_then_on(compiled, damage, suffix):
    source, cache = compiled
    [path] = cache.glob(f"*.{suffix}")
    path.write_bytes(DAMAGE[damage](path.read_bytes()))
    kernel = fresh(source)
    assert kernel(3) == 7
    assert sum(kernel.stats.cache_hits.values()) == 0
    again = fresh(source)
    assert again(3) == 7
    assert sum(again.stats.cache_hits.values()) == 1
    assert len(list(cache.glob("*.nb?"))) == 2


def test_a_whole_file_is_not_compiled_again(compiled):
    kernel = fresh(compiled[0])
    assert kernel(3) == 7
    assert sum(kernel.stats.cache_hits.values()) == 1


def test_numba_alone_reads_what_we_wrote_and_we_what_numba_wrote(compiled):
    source, cache = compiled
    [code], [index] = cache.glob("*.nbc"), cache.glob("*.nbi")
    assert pickle.loads(code.read_bytes())[0]
    assert pickle.loads(index.read_bytes()) == numba.__version__
    for path in (code, index):
        path.write_bytes(path.read_bytes()[:-48])
    kernel = fresh(source)
    assert kernel(3) == 7
    assert sum(kernel.stats.cache_hits.values()) == 1


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_a_kernel_runs_where_its_cache_cannot_be_written(compiled, suffix):
    source, cache = compiled
    [path] = cache.glob(f"*.{suffix}")
    path.unlink()
    path.mkdir()
    assert fresh(source)(3) == 7


def test_every_kernel_of_ours_forgives_damage():
    script = (
        "from numba.core.caching import Cache\n"
        "import fabricusd.{}\n"
        "assert Cache._load_overload.__module__ == 'fabricusd.kernels.damaged_cache'"
    )
    for module in (
        "appearance.weave.compiled",
        "reference.rays.embree",
        "bake.layout.raster",
        "appearance.published.far",
    ):
        done = subprocess.run([sys.executable, "-c", script.format(module)])
        assert done.returncode == 0, module
