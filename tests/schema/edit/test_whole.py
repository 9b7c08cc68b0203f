"""A whole fabric as a variant: what it holds, and what stays as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, Thread, ThreadSet, Weave
from fabricusd.schema.check import check
from fabricusd.schema.edit.whole import save_variant
from fabricusd.schema.read import load
from fabricusd.schema.write import save

BASE = Fabric(
    name="Mine",
    threads={"A": Thread(albedo=(0.1, 0.2, 0.3), hairiness=2.0), "B": Thread(model="thesis")},
    warp=ThreadSet(sequence=(0, 1), density=2500.0), weft=ThreadSet(density=1800.0, coverage=0.3),
    documentation="where it comes from",
)  # fmt: skip

OTHER = replace(
    BASE,
    threads={
        "A": replace(BASE.threads["A"], gamma_surface=0.123456789, hairiness=0.0, plies=2, twist=9),
        "B": replace(BASE.threads["B"], ior=1.33),
    },
    weave=Weave(np.array([[1, 0, 1]], bool), "drawn"),
    warp=replace(BASE.warp, coverage=0.7),
)  # fmt: skip


def test_every_number_and_the_weave_are_read_back(tmp_path):
    path = tmp_path / "a.usda"
    told = save_variant(path, "other", OTHER, BASE)
    assert load(path) == OTHER
    assert load(f"{path}{{fabricVariant=original}}") == BASE
    assert check(path) == []
    # A variant holds what differs, and nothing else.
    assert sorted(line.rpartition(" ")[2] for line in told) == [
        "fabric:warp:coverage", "fabric:weave:name", "fabric:weave:rows", "thread:gammaSurface",
        "thread:hairiness", "thread:ior", "thread:plies", "thread:twist",
    ]  # fmt: skip


def test_a_variant_is_replaced_and_others_stay(tmp_path):
    path = tmp_path / "a.usda"
    save_variant(path, "one", OTHER, BASE)
    save_variant(path, "two", BASE, BASE)
    save_variant(path, "one", replace(OTHER, warp=BASE.warp), BASE)
    assert load(f"{path}{{fabricVariant=one}}").warp == BASE.warp
    assert load(f"{path}{{fabricVariant=one}}").weave == OTHER.weave
    assert load(f"{path}{{fabricVariant=two}}") == BASE


@pytest.mark.parametrize("name", ["", "no name", "../a", "a=b=c"])
def test_a_variant_without_a_name_is_refused_unwritten(tmp_path, name):
    with pytest.raises(FabricError, match="is not a name"):
        save_variant(tmp_path / "a.usda", name, OTHER, BASE)
    assert list(tmp_path.iterdir()) == []


def test_a_layer_of_another_cloth_is_refused_and_kept(tmp_path):
    path = tmp_path / "a.usda"
    save(Fabric(), path)
    before = path.read_bytes()
    with pytest.raises(FabricError, match=rf"{path}:/Fabric has 1 threads; it must have 2"):
        save_variant(path, "other", OTHER, BASE)
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == ["a.usda"]
