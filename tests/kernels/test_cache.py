"""Kernels are cached for one state of the sources, in the user's own folder."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fabricusd.kernels.cache import PACKAGE, digest_of, fingerprint, sources

ROOT = PACKAGE.parent
WHERE = "from fabricusd.appearance.thread import _density_soa as k; print(k.stats.cache_path)"


@pytest.fixture
def copy(tmp_path):
    """The sources that kernels are made of, to be changed."""
    for path in sources():
        target = tmp_path / path.relative_to(PACKAGE)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    return tmp_path


def test_the_same_sources_elsewhere_have_the_same_digest_of(copy):
    assert digest_of(copy) == fingerprint()


@pytest.mark.parametrize("name", ["fabric.py", "appearance/scattering/lobes.py", "kernels/real.py"])
def test_a_change_in_any_source_changes_the_digest_of(copy, name):
    with (copy / name).open("a") as stream:
        stream.write("# changed\n")
    assert digest_of(copy) != fingerprint()


def test_every_module_with_kernels_is_among_the_sources_and_chooses_the_folder_first():
    known = set(sources())
    with_kernels = [
        path
        for path in PACKAGE.rglob("*.py")
        if re.search(r"^@njit|^@vectorize", path.read_text(), re.M)
    ]
    assert len(with_kernels) > 20
    for path in with_kernels:
        assert path in known, path
        assert re.search(r"^(from|import) fabricusd\.kernels", path.read_text(), re.M), path


def run(code, **variables):
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT,
        env={"PATH": "", "PYTHONPATH": str(ROOT), **variables},
    )  # fmt: skip
    return done.stdout.strip()


def test_kernels_go_into_the_folder_of_the_user_and_not_beside_the_sources(tmp_path):
    where = Path(run(WHERE, FABRICUSD_CACHE_DIR=str(tmp_path)))
    assert where.parent == tmp_path / "kernels" / fingerprint()


def test_a_folder_that_numba_was_given_is_left_alone(tmp_path):
    assert Path(run(WHERE, NUMBA_CACHE_DIR=str(tmp_path))).parent == tmp_path
