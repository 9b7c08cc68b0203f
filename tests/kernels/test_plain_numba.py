"""Kernels are the same where numba's internals are not used."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from fabricusd.kernels import internals, real
from fabricusd.kernels.parts import PartCompiler

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


@pytest.mark.slow
def test_values_without_internals_are_those_with_them():
    without, found = values(**{internals.VARIABLE: "1"})
    plain, expected = values()
    assert without
    assert not plain
    for a, b in zip(found, expected, strict=True):
        assert np.isfinite(b).all()
        assert (b > 0).any()
        np.testing.assert_allclose(a, b, rtol=1e-12)


def test_another_version_of_numba_is_used_as_it_is(monkeypatch):
    assert real.PartCompiler is PartCompiler
    assert internals.use_internals()
    monkeypatch.setattr(internals.numba, "__version__", "0.99.0")
    assert not internals.use_internals()
