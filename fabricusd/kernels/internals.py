"""Decide whether to use numba's internals, which compile the first picture a third faster.

Nothing depends on them. In a version of numba in which they have not been tried, where one of them
is missing, and where FABRICUSD_PLAIN_NUMBA is 1, numba compiles the kernels as it is. Where
FABRICUSD_PLAIN_NUMBA is 0, the internals are used in a version that has not been tried, too: that
is how `bench/numba_versions.py` tries one.
"""

from __future__ import annotations

import os

import numba

VARIABLE = "FABRICUSD_PLAIN_NUMBA"

TRIED = ("0.60.", "0.61.", "0.64.", "0.68.")
"""Beginnings of the versions in which `parts` and `start` have been tried, in ascending order."""


def use_internals() -> bool:
    """Whether `parts` and `start` may go beyond numba's public interface."""
    asked = os.environ.get(VARIABLE, "")
    if asked == "0":
        return True
    return not asked and numba.__version__.startswith(TRIED)
