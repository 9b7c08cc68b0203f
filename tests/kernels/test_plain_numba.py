"""Kernels are the same where numba's internals are not used."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from numba.core.compiler import Compiler

from fabricusd.kernels import internals, real
from fabricusd.kernels.parts import PartCompiler

PROJECT = Path(__file__).parents[2] / "pyproject.toml"

VALUES = """
import json, numpy as np
from numba.core.compiler import Compiler
from fabricusd.appearance import surface, thread
from fabricusd.kernels import real
from fabricusd.schema import load
w = np.random.default_rng(3).normal(size=(2, 40, 3))
w /= np.linalg.norm(w, axis=-1, keepdims=True)
flat = load("silk_shot")
found = [thread.evaluate(next(iter(flat.threads.values())), *w), surface.evaluate(flat, *abs(w))]
plain = real.PartCompiler is Compiler
print(json.dumps([plain, [v.tolist() for v in found]]))
"""


def values(**variables):
    done = subprocess.run(
        [sys.executable, "-c", VALUES], env={**os.environ, **variables}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    plain, found = json.loads(done.stdout)
    return plain, [np.array(v) for v in found]


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.skipif(not internals.use_internals(), reason="this run uses numba as it is")
def test_values_without_internals_are_those_with_them():
    without, found = values(**{internals.VARIABLE: "1"})
    plain, expected = values()
    assert without
    assert not plain
    for a, b in zip(found, expected, strict=True):
        assert np.isfinite(b).all()
        assert (b > 0).any()
        np.testing.assert_allclose(a, b, rtol=1e-12)


def test_parts_are_compiled_by_the_compiler_that_is_chosen():
    assert real.PartCompiler is (PartCompiler if internals.use_internals() else Compiler)


@pytest.mark.parametrize("version", [f"{tried}1" for tried in internals.TRIED])
def test_a_tried_version_of_numba_is_used_with_its_internals(monkeypatch, version):
    monkeypatch.setattr(internals.numba, "__version__", version)
    monkeypatch.delenv(internals.VARIABLE, raising=False)
    assert internals.use_internals()
    monkeypatch.setenv(internals.VARIABLE, "1")
    assert not internals.use_internals()


def test_another_version_of_numba_is_used_as_it_is_unless_it_is_being_tried(monkeypatch):
    monkeypatch.setattr(internals.numba, "__version__", "0.99.0")
    monkeypatch.delenv(internals.VARIABLE, raising=False)
    assert not internals.use_internals()
    monkeypatch.setenv(internals.VARIABLE, "0")
    assert internals.use_internals()


def test_the_pin_of_numba_begins_and_ends_with_versions_that_were_tried():
    needs = tomllib.loads(PROJECT.read_text())["project"]["dependencies"]
    [pin] = [need.removeprefix("numba") for need in needs if need.startswith("numba")]
    minors = [int(version.split(".")[1]) for version in internals.TRIED]
    assert minors == sorted(minors)
    assert pin == f">=0.{minors[0]},<0.{minors[-1] + 1}"
