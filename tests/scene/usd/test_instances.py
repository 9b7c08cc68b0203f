"""Point instancers and native instances: arrays that do not fit, and scenes that are too large."""

from __future__ import annotations

import time

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from fabricusd.scene.read import read_scene
from fabricusd.scene.usd import instances as usd_instances
from tests.conftest import CHECKOUT
from tests.fuzz import bounded_memory
from tests.reference.stages import new_stage, read, square

CASES = CHECKOUT / "tests" / "cases"


def instancer(stage, path="/many", prototype="/Protos/square", count=3):
    if not stage.GetPrimAtPath("/Protos"):
        square(stage, "/Protos/square")
        stage.GetPrimAtPath("/Protos").SetSpecifier(Sdf.SpecifierOver)
    one = UsdGeom.PointInstancer.Define(stage, path)
    one.CreatePrototypesRel().SetTargets([prototype])
    one.CreatePositionsAttr(Vt.Vec3fArray(count))
    one.CreateProtoIndicesAttr(Vt.IntArray(count))
    return one


LENGTHS = {
    "positions": lambda one, n: one.CreatePositionsAttr(Vt.Vec3fArray(n)),
    "orientations": lambda one, n: one.CreateOrientationsAttr(Vt.QuathArray(n)),
    "orientationsf": lambda one, n: one.CreateOrientationsfAttr(Vt.QuatfArray(n)),
    "scales": lambda one, n: one.CreateScalesAttr(Vt.Vec3fArray(n)),
    "velocities": lambda one, n: one.CreateVelocitiesAttr(Vt.Vec3fArray(n)),
    "accelerations": lambda one, n: one.CreateAccelerationsAttr(Vt.Vec3fArray(n)),
    "angularVelocities": lambda one, n: one.CreateAngularVelocitiesAttr(Vt.Vec3fArray(n)),
    "ids": lambda one, n: one.CreateIdsAttr(Vt.Int64Array(n)),
}


@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize("name", LENGTHS)
def test_an_instancer_with_an_array_of_another_length_is_left_out(tmp_path, name, count):
    stage = new_stage(tmp_path)
    LENGTHS[name](instancer(stage), count)
    scene = read(stage)
    assert not scene.meshes
    assert any(
        "/many has arrays of different lengths" in n and f"{count} {name}, left out" in n
        for n in scene.notes
    )


def test_an_instancer_without_positions_is_left_out(tmp_path):
    stage = new_stage(tmp_path)
    instancer(stage).GetPositionsAttr().Clear()
    assert not read(stage).meshes


def test_prototype_indices_of_another_length_are_left_out(tmp_path):
    stage = new_stage(tmp_path)
    instancer(stage).GetProtoIndicesAttr().Set([0, 0])
    scene = read(stage)
    assert not scene.meshes
    assert any("2 protoIndices and 3 positions" in n for n in scene.notes)


def test_one_scale_for_three_instances_is_left_out():
    scene = read_scene(CASES / "usd_instancer_short_scales" / "short.usda")
    assert not scene.meshes
    assert any("has arrays of different lengths" in n for n in scene.notes)


def test_arrays_that_fit_are_all_obeyed(tmp_path):
    stage = new_stage(tmp_path)
    one = instancer(stage, count=2)
    one.GetPositionsAttr().Set([(0, 0, 0), (10, 0, 0)])
    one.CreateScalesAttr([(1, 1, 1), (2, 2, 2)])
    one.CreateOrientationsAttr([Gf.Quath(1), Gf.Quath(0, 1, 0, 0)])
    one.CreateVelocitiesAttr(Vt.Vec3fArray(2))
    one.CreateIdsAttr([7, 8])
    one.CreateInvisibleIdsAttr([7])
    [mesh] = read(stage).meshes
    assert mesh.points.min(axis=0) == pytest.approx([8, 0, -2], abs=1e-3)


def flat(stage):
    instancer(stage, count=10_000_000)


def nested(stage):
    """A hundred of a hundred of a hundred..., six deep."""
    below = "/Protos/square"
    for depth in range(6):
        instancer(stage, f"/Level{depth}/many", below, 100)
        if depth < 5:
            stage.GetPrimAtPath(f"/Level{depth}").SetSpecifier(Sdf.SpecifierOver)
        below = f"/Level{depth}"


def native(stage):
    """Native instances: thirty of thirty of thirty..., six deep."""
    instancer(stage, count=1)
    below = "/Protos"
    for depth in range(6):
        for k in range(30):
            prim = stage.DefinePrim(f"/Level{depth}/copy{k}")
            prim.GetReferences().AddInternalReference(below)
            prim.SetInstanceable(True)
        if depth < 5:
            stage.GetPrimAtPath(f"/Level{depth}").SetSpecifier(Sdf.SpecifierOver)
        below = f"/Level{depth}"


def native_around_instancers(stage):
    instancer(stage, "/Level/many", count=1000)
    stage.GetPrimAtPath("/Level").SetSpecifier(Sdf.SpecifierOver)
    for k in range(300):
        prim = stage.DefinePrim(f"/copy{k}")
        prim.GetReferences().AddInternalReference("/Level")
        prim.SetInstanceable(True)


def large_prototype(stage):
    """Few instances, many triangles."""
    instancer(stage, count=1000)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Protos/square"))
    mesh.GetFaceVertexCountsAttr().Set(Vt.IntArray(50_000, 4))
    mesh.GetFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(np.tile([0, 3, 2, 1], 50_000)))


TOO_LARGE = {
    # name: (the stage, words of the note, meshes that are placed)
    "ten million instances": (flat, "is left out: it leads to 1e+07 instances; at most 100000", 0),
    "a hundred, nested six deep": (nested, "is left out: it leads to 1.01e+12 instances", 0),
    "native instances, nested six deep": (native, "is left out: it leads to 2.51e+07 instances", 1),
    "a hundred million triangles": (large_prototype, "is left out: it leads to 1e+08 triangles", 0),
}


@pytest.mark.parametrize("name", TOO_LARGE)
def test_instances_above_the_bound_are_counted_and_left_out_at_once(tmp_path, name):
    make, words, placed = TOO_LARGE[name]
    stage = Usd.Stage.CreateNew(str(tmp_path / "large.usdc"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    make(stage)
    stage.GetRootLayer().Save()
    began = time.process_time()
    with bounded_memory():
        scene = read_scene(tmp_path / "large.usdc")
    assert time.process_time() - began < 1.0
    assert any(words in note for note in scene.notes)
    assert len(scene.meshes) == placed
    assert len(scene.notes) < 5


def test_instances_are_placed_as_long_as_there_is_room(tmp_path, monkeypatch):
    monkeypatch.setattr(usd_instances, "MOST_COPIES", 7)
    stage = new_stage(tmp_path)
    for k in range(4):
        instancer(stage, f"/many{k}", count=3)
    scene = read(stage)
    assert len(scene.meshes) == 6
    assert any("/many2 is left out: it leads to 9 instances; at most 7" in n for n in scene.notes)
    assert any("has 1 more prims left out for that" in n for n in scene.notes)


def test_instancers_in_native_instances_are_counted_with_them(tmp_path, monkeypatch):
    monkeypatch.setattr(usd_instances, "MOST_COPIES", 5000)
    stage = new_stage(tmp_path)
    native_around_instancers(stage)
    scene = read(stage)
    assert len(scene.meshes) == 4000
    assert any("it leads to 5005 instances" in n for n in scene.notes)


def test_hidden_instances_are_not_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(usd_instances, "MOST_COPIES", 2)
    stage = new_stage(tmp_path)
    one = instancer(stage, count=4)
    one.CreateInvisibleIdsAttr([0, 1])
    assert len(read(stage).meshes) == 2
