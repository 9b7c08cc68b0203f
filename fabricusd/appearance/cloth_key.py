"""What to name in the cache what depends on a cloth alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fabricusd.fabric import Fabric, Weave


def cloth_key(fabric: Fabric) -> tuple[object, ...]:
    """What `cache.kept` may take as a key of the front of `fabric`: everything that it says."""
    # colour-science changes how NumPy prints its numbers.
    with np.printoptions(legacy=False):
        said = repr(replace(fabric, weave=_ANY_WEAVE, back=None))
    return said, fabric.weave.cells


_ANY_WEAVE = Weave(np.eye(2, dtype=bool))
"""Stands for a weave, whose text would leave out the middle of a large array."""
