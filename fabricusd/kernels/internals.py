"""Decide whether to use numba's internals, which compile the first picture a third faster.

Nothing depends on them. Plain numba compiles the kernels if the installed version has not been
tried, if an internal is missing, or if FABRICUSD_PLAIN_NUMBA is set.
"""

from __future__ import annotations

import os

import numba

VARIABLE = "FABRICUSD_PLAIN_NUMBA"

TRIED = ("0.68.",)
"""Prefixes of the numba versions with which `parts` and `start` have been tried."""


def use_internals() -> bool:
    """Whether `parts` and `start` may go beyond numba's public interface."""
    return not os.environ.get(VARIABLE) and numba.__version__.startswith(TRIED)
