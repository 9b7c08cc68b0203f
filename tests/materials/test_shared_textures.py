"""Looks of meshes that share textures, being copies of one another."""

from __future__ import annotations

import json

from pxr import Sdf, Usd, UsdGeom

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings as Wanted
from tests.materials.scenes import MAPS
from tests.reference.stages import bind_fabric, new_stage, square


def two_sleeves(folder):
    """A square, and the same one moved and turned."""
    stage = new_stage(folder)
    for path, place, angle in (("/Left", (0, 0, 0), 0), ("/Right", (5, 1, 0), 30)):
        mesh = square(stage, path)
        UsdGeom.XformCommonAPI(mesh).SetTranslate(place)
        UsdGeom.XformCommonAPI(mesh).SetRotate((0, angle, 0))
        bind_fabric(stage, mesh.GetPrim())
    stage.GetRootLayer().Save()
    return folder / "scene.usda"


def test_copies_get_the_look_of_the_textures_that_they_share_until_one_is_deformed(tmp_path):
    scene, wanted = two_sleeves(tmp_path), Wanted(fitted=False)
    bake(scene, tmp_path / "b", Settings(resolution=64, maps=MAPS), workers=1)
    said = json.loads((tmp_path / "b" / "manifest.json").read_text())
    assert [one["prims"] for one in said["garments"].values()] == [["/Left", "/Right"]]
    made = write_materials(tmp_path / "b", tmp_path / "look.usda", wanted, scene=scene)
    assert made.notes == []
    looked = Usd.Stage.Open(str(tmp_path / "look.usda"))
    for path in ("/Left", "/Right"):
        assert looked.GetPrimAtPath(path).GetRelationship("material:binding").HasAuthoredTargets()
    layer = Sdf.Layer.FindOrOpen(str(scene))
    points = layer.GetAttributeAtPath("/Right.points")
    points.default = [p * 2 if k == 0 else p for k, p in enumerate(points.default)]
    layer.Save()
    made = write_materials(tmp_path / "b", tmp_path / "look.usda", wanted, scene=scene)
    assert [note.split()[0] for note in made.notes] == ["/Right"]
