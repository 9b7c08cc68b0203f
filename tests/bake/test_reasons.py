"""What a bake refuses, with what the scene's reader had to say of it."""

from __future__ import annotations

import pytest
from pxr import Gf, Sdf, UsdGeom

from fabricusd.bake.bake import bake, plan
from fabricusd.bake.job import Settings
from fabricusd.errors import FabricError
from tests.conftest import CHECKOUT
from tests.reference.stages import bind_fabric, new_stage, square

CASES = CHECKOUT / "tests" / "cases" / "bake_hides_the_reason"

REASONS = {
    "short_st": ("has no UVs for its fabric", "/Root/Panel has a UV set 'st' that does not fit"),
    "broken_payload": ("has no mesh that could be baked", "Could not open asset @nosuch.usda@"),
}


@pytest.mark.parametrize("make", [plan, bake])
@pytest.mark.parametrize("name", REASONS)
def test_a_refusal_carries_the_note_that_render_gives(tmp_path, name, make):
    scene, out = CASES / f"{name}.usda", tmp_path / "out"
    with pytest.raises(FabricError) as error:
        plan(scene, Settings()) if make is plan else bake(scene, out)
    assert not out.exists()
    assert "\n" not in str(error.value)
    for words in REASONS[name]:
        assert words in str(error.value)


def other_name(stage):
    mesh = square(stage, uv=False)
    bind_fabric(stage, mesh.GetPrim())
    mesh.GetPrim().GetAttribute("fabric:binding:uvSet").Set("other")


def mistyped_uvs(stage):
    mesh = square(stage, uv=False)
    UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.StringArray, "vertex").Set(
        ["a"] * 4
    )
    bind_fabric(stage, mesh.GetPrim())


def no_api(stage):
    mesh = square(stage)
    bind_fabric(stage, mesh.GetPrim())
    mesh.GetPrim().RemoveAPI("WovenBindingAPI")


def broken_fabric(stage):
    mesh = square(stage)
    bind_fabric(stage, mesh.GetPrim())
    stage.GetPrimAtPath("/Looks/Cloth").GetAttribute("fabric:warp:density").Set(-1.0)


def fabric_on_a_group(stage):
    square(stage, "/group/square")
    bind_fabric(stage, stage.GetPrimAtPath("/group"))


def far_points(stage):
    mesh = square(stage)
    bind_fabric(stage, mesh.GetPrim())
    mesh.GetPointsAttr().Set([(1e30, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)])


def short_instancer(stage):
    mesh = square(stage, "/many/square")
    bind_fabric(stage, mesh.GetPrim())
    many = UsdGeom.PointInstancer.Define(stage, "/many")
    many.CreatePrototypesRel().SetTargets([mesh.GetPath()])
    many.CreatePositionsAttr([(0, 0, 0)] * 3)
    many.CreateProtoIndicesAttr([0, 0, 0])
    many.CreateScalesAttr([Gf.Vec3f(1)])


def names_missing_points(stage):
    mesh = square(stage)
    bind_fabric(stage, mesh.GetPrim())
    mesh.GetFaceVertexIndicesAttr().Set([0, 3, 2, 9])


CAUSES = {
    # name: (the stage, words of the reason)
    "a UV set that is not there": (other_name, "uvSet"),
    "UVs that are no numbers": (mistyped_uvs, "has a UV set 'st' that does not fit its faces"),
    "the API is missing": (no_api, "has fabric:binding but not WovenBindingAPI applied"),
    "a fabric with a fault": (broken_fabric, "rendered without a fabric"),
    "a fabric on a group": (fabric_on_a_group, "/group binds a fabric, left out"),
    "points beyond the world": (far_points, "1 points beyond 1e+09 m"),
    "an instancer that does not fit": (short_instancer, "has arrays of different lengths"),
    "a point that is not there": (names_missing_points, "/square names point 9 of 4, left out"),
}


@pytest.mark.parametrize("name", CAUSES)
def test_every_refusal_names_its_cause(tmp_path, name):
    make, words = CAUSES[name]
    stage = new_stage(tmp_path)
    make(stage)
    stage.GetRootLayer().Save()
    with pytest.raises(FabricError) as error:
        plan(stage.GetRootLayer().realPath, Settings())
    assert words in str(error.value)
    assert str(error.value).count(words) == 1


def test_a_mesh_asked_for_by_name_that_was_left_out_says_why(tmp_path):
    stage = new_stage(tmp_path)
    names_missing_points(stage)
    square(stage, "/other")
    stage.GetRootLayer().Save()
    with pytest.raises(FabricError, match=r"must be one of /other.*/square names point 9"):
        plan(stage.GetRootLayer().realPath, Settings(), mesh="/square")


def test_many_reasons_are_cut_short(tmp_path):
    stage = new_stage(tmp_path)
    for k in range(9):
        bind_fabric(stage, UsdGeom.Xform.Define(stage, f"/group{k}").GetPrim())
    stage.GetRootLayer().Save()
    with pytest.raises(FabricError, match=r"/group0 binds.*and \d more") as error:
        plan(stage.GetRootLayer().realPath, Settings())
    assert len(str(error.value)) < 600
