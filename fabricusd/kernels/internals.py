"""Whether numba's internals are used, which makes the first picture a third faster to compile.

Nothing depends on them. In a version of numba where they have not been tried, or where one is
missing, and with FABRICUSD_PLAIN_NUMBA set, kernels are compiled by numba as it is.
"""

from __future__ import annotations

import os

import numba

VARIABLE = "FABRICUSD_PLAIN_NUMBA"

TRIED = ("0.68.",)
"""Beginnings of the versions in which `parts` and `start` have been tried."""


def use_internals() -> bool:
    """Whether `parts` and `start` may go beyond numba's public interface."""
    return not os.environ.get(VARIABLE) and numba.__version__.startswith(TRIED)
