"""A layer says of each number where it is from, and still reads as the fabric."""

from __future__ import annotations

import pytest
from pxr import Sdf

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.measure.estimates_file import save_measured
from fabricusd.schema import load

MEASURED = {
    "warp A red": (0.3, 0.2, 0.4, "", "fitted"),
    "warp density": (22.0, 21.0, 23.0, "per cm", "spectrum"),
}


def test_values_intervals_and_sources_lie_beside_the_fabric(tmp_path):
    path = tmp_path / "cloth.usda"
    save_measured(Fabric(name="Cloth"), MEASURED, path, photograph="a.png", notes=("one", "two"))
    assert load(path).name == "Cloth"
    layer = Sdf.Layer.FindOrOpen(str(path))  # held: a spec does not keep its layer alive
    held = layer.GetPrimAtPath("/Cloth").customData["fabricusd"]
    assert held["photograph"] == "a.png"
    assert held["notes"] == "one\ntwo"
    assert dict(held["measured"]["warpARed"]) == {
        "value": 0.3, "low": 0.2, "high": 0.4, "unit": "", "source": "fitted",
    }  # fmt: skip
    assert held["measured"]["warpDensity"]["unit"] == "per cm"


def test_a_file_is_kept_where_it_must_be(tmp_path):
    path = tmp_path / "cloth.usda"
    path.write_text("kept")
    with pytest.raises(FabricError, match="exists"):
        save_measured(Fabric(), {}, path, photograph="a.png", clobber=False)
    assert path.read_text() == "kept"
