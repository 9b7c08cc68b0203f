"""`material` with the surface of lobes, from the bake to the files."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from materials.scenes import bake_shirt
from pxr import Usd, UsdShade

from fabricusd.errors import FabricError
from fabricusd.materials import recipes
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.lobes.known import from_dict, mixture_of
from fabricusd.materials.lobes.mixture import CYCLES
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings, mean_inputs
from fabricusd.materials.targets.blender.addon import looks
from fabricusd.schema import load


@pytest.fixture(scope="module")
def shirt(tmp_path_factory):
    return bake_shirt(tmp_path_factory.mktemp("shirt"))


@pytest.fixture
def quick(monkeypatch):
    """Without the fits of other surfaces, which these tests do not read."""
    monkeypatch.setattr(recipes, "draw_texels", lambda *_: None)


def written(shirt, folder, *surfaces, **more):
    scene, baked = shirt
    path = folder / "look.usda"
    # Single threads have tests of their own, tests/materials/near.
    settings = Settings(surfaces=surfaces, near="off", **more)
    made = write_materials(baked, path, settings, scene=scene)
    return path, made


def identifiers(path):
    stage = Usd.Stage.Open(str(path))
    return {
        UsdShade.Shader(prim).GetIdAttr().Get()
        for prim in stage.Traverse()
        if prim.IsA(UsdShade.Shader)
    }


def test_beside_openpbr_the_lobes_are_in_the_document(shirt, tmp_path, quick):
    path, made = written(shirt, tmp_path, "openpbr", "lobes")
    root = ElementTree.parse(path.with_suffix(".mtlx")).getroot()
    names = {one.get("name") for one in root.findall("surfacematerial")}
    assert sum(name.endswith("_lobes") for name in names) == len(names) / 2 > 0
    assert len(root.findall("nodedef")) == 1
    assert "ND_generalized_schlick_bsdf" not in identifiers(path)
    said = json.loads(path.with_suffix(".json").read_text())["lobes"]
    assert {where: from_dict(one) for where, one in said.items()} == made.lobes
    assert [one.count for one in made.lobes.values()] == [4, 4]


@pytest.mark.exhaustive
def test_alone_the_lobes_are_the_network_in_usd(shirt, tmp_path, quick):
    path, made = written(shirt, tmp_path, "lobes", lobes=6)
    found = identifiers(path)
    assert {"ND_generalized_schlick_bsdf", "ND_add_bsdf", "ND_surface"} <= found
    assert not any("fabricusd" in one for one in found)
    assert [one.count for one in made.lobes.values()] == [6, 6]


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            Settings(surfaces=("lobes",), lobes=7),
            "lobes is 7; it must be a whole number from 1 to 6",
        ),
        (Settings(surfaces=("lobes",), max_error=0.0), "max_error is 0; it must be above 0"),
        (Settings(surfaces=("lobes",), fitted=False), "cannot be written with --no-fit"),
    ],
)
def test_what_cannot_be_fitted_is_refused_before_any_work(shirt, tmp_path, settings, told):
    with pytest.raises(FabricError, match=told):
        write_materials(shirt[1], tmp_path / "look.usda", settings)
    assert not list(tmp_path.iterdir())


def test_the_number_of_lobes_does_not_matter_to_other_surfaces(shirt, tmp_path, quick):
    made = written(shirt, tmp_path, "openpbr")[1]
    assert made.lobes == {}


def test_a_bound_that_a_fit_met_is_a_remark_and_not_a_note(shirt, tmp_path, quick, monkeypatch):
    def steep(*args, **more):
        found = real(*args, **more)
        return replace(found, lobes=(replace(found.lobes[0], facing=4.0), *found.lobes[1:]))

    real = recipes.mixture_of
    monkeypatch.setattr(recipes, "mixture_of", steep)
    made = written(shirt, tmp_path, "lobes")[1]
    assert sum("facing of lobe 0 is at its greatest" in line for line in made.remarks) == 2
    assert not any("facing" in line for line in made.notes)


def test_gaps_do_not_dim_the_lobes_twice(shirt, tmp_path, quick):
    """A mixture is the radiance of the whole cloth; the opacity of the look covers its share."""
    path = written(shirt, tmp_path, "openpbr", "lobes")[0]
    cover = mean_inputs(read_bake_folder(shirt[1]).garments[0], 0)["opacity"].value
    assert cover < 0.9
    linen = mixture_of(load("linen_plain"), 4, CYCLES)
    (look,) = [one for one in looks.read(Usd.Stage.Open(str(path))) if one.name == "Body_0"]
    assert look.mixture.view[0] == pytest.approx(linen.view[0] - math.log(cover), rel=1e-5)
    assert look.mixture.view[1:] == pytest.approx(linen.view[1:], rel=1e-5)
    (velvet,) = [one for one in looks.read(Usd.Stage.Open(str(path))) if one.name == "Body_1"]
    assert not velvet.transparent
    assert velvet.mixture.view == pytest.approx(
        mixture_of(load("velvet"), 4, CYCLES).view, rel=1e-5
    )
