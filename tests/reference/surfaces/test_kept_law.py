"""The law of a cloth that was rendered before comes from the cache, as it was made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.reference.surfaces import fabric as module
from fabricusd.reference.surfaces.fabric import FabricShader
from fabricusd.schema import load


def same(a, b) -> bool:
    """Whether two groups of tables are alike to the bit, and of the same types."""
    if hasattr(a, "_asdict"):
        return type(a) is type(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    kinds = [getattr(x, "dtype", type(x)) for x in (a, b)]
    return kinds[0] == kinds[1] and np.array_equal(a, b)


# The back of a plain weave of one thread is its front.
@pytest.mark.parametrize(("name", "sides"), [("linen_plain", 1), ("denim", 2)])
def test_a_law_is_made_once(name, sides, monkeypatch, tmp_path):
    fabric, made, real = load(name), [], module.surface_law
    monkeypatch.setenv("FABRICUSD_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(
        module, "surface_law", lambda *a, **b: made.append(real(*a, **b)) or made[-1]
    )
    first = [side.law for side in FabricShader(fabric, "horizon").sides]
    assert len(made) == sides
    again = [side.law for side in FabricShader(replace(fabric, documentation="x"), "horizon").sides]
    assert len(made) == sides
    for found in (first, again):
        assert same(found[0], made[0])
        assert same(found[1], made[-1])
    assert all(x.flags.writeable for law in again for x in law.published if np.ndim(x))


def test_what_changes_the_law_is_no_other_cloth_s(monkeypatch, tmp_path):
    fabric, made, real = load("linen_plain"), [], module.surface_law
    monkeypatch.setenv("FABRICUSD_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(
        module, "surface_law", lambda *a, **b: made.append(real(*a, **b)) or made[-1]
    )
    thread = replace(fabric.threads["Linen"], ior=1.4600001)
    turned = replace(fabric.weave, cells=~np.asarray(fabric.weave.cells))
    for one, shadow in (
        (fabric, "horizon"), (fabric, "none"), (replace(fabric, threads={"Linen": thread}), "none"),
        (replace(fabric, weave=turned), "none"),
    ):  # fmt: skip
        count = len(made)
        assert FabricShader(one, shadow).sides[0].law
        assert len(made) == count + 1
