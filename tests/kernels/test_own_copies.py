"""A kernel's results do not depend on which other kernels a process has compiled or loaded."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from llvmlite.binding import Linkage
from numba import njit

from fabricusd.kernels.internals import use_internals

pytestmark = pytest.mark.skipif(not use_internals(), reason="numba compiles as it is")

EVALUATED = """
import hashlib
import numpy as np
from fabricusd.appearance.surface import evaluate
from fabricusd.schema import load

w = abs(np.random.default_rng(0).normal(size=(2, 4096, 3)))
values = evaluate(load("gauze"), *(w / np.linalg.norm(w, axis=-1, keepdims=True)))
print(hashlib.sha256(values.tobytes()).hexdigest())
"""


@njit
def shared(x: float) -> float:
    """A function that two kernels call, and that is not inlined: it calls itself twice."""
    return x if x < 2.0 else shared(x - 1.0) + shared(x - 2.0)


@njit
def caller(x: float) -> float:
    """A kernel that has a copy of it."""
    return shared(x) + 1.0


def test_what_a_kernel_has_linked_is_its_own_and_can_still_be_linked():
    assert caller(6.0) == 9.0
    library = next(iter(caller.overloads.values())).library

    def linkages(module):
        return {f.linkage for f in module.functions if "shared" in f.name and not f.is_declaration}

    assert linkages(library._final_module) == {Linkage.internal}
    assert linkages(library._get_module_for_linking()) == {Linkage.linkonce_odr}


@pytest.mark.exhaustive
def test_a_process_that_compiles_and_one_that_loads_agree_to_the_bit(tmp_path):
    found = {
        subprocess.run(
            [sys.executable, "-c", EVALUATED], check=True, capture_output=True, text=True,
            env={**os.environ, "FABRICUSD_CACHE_DIR": str(tmp_path), "NUMBA_NUM_THREADS": "2"},
        ).stdout
        for _ in range(2)
    }  # fmt: skip
    assert len(found) == 1
