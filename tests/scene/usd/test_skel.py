"""Skinned meshes and blend shapes, against what `UsdSkel.BakeSkinning` makes of the same stage."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from fabricusd.scene.copies import with_copies
from fabricusd.scene.read import read_scene
from tests.conftest import CHECKOUT
from tests.reference.stages import new_stage, read

SKINNED = CHECKOUT / "tests" / "cases" / "usd_skinned" / "skel.usda"
POINTS = [(-0.5, 0, 0), (0.5, 0, 0), (0.5, 1, 0), (-0.5, 1, 0), (0.5, 2, 0), (-0.5, 2, 0)]
JOINTS = ["hip", "hip/knee"]


def sleeve(stage: Usd.Stage, root: str = "/Body") -> UsdGeom.Mesh:
    """Two squares one above the other on two joints; from frame 1 to 2 the upper one turns, the
    lower one moves."""
    UsdSkel.Root.Define(stage, root)
    skeleton = UsdSkel.Skeleton.Define(stage, f"{root}/Skel")
    UsdGeom.XformCommonAPI(skeleton).SetTranslate((0, 1, 0))
    rest = [Gf.Matrix4d(1), Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(0, 1, 0))]
    skeleton.CreateJointsAttr(JOINTS)
    skeleton.CreateBindTransformsAttr(rest)
    skeleton.CreateRestTransformsAttr(rest)
    animation = UsdSkel.Animation.Define(stage, f"{root}/Skel/Anim")
    animation.CreateJointsAttr(JOINTS)
    animation.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1), Gf.Vec3h(1, 2, 1)]))
    turned = Gf.Quatf(Gf.Rotation((0, 0, 1), 60).GetQuat())
    for time, quaternion, move in ((1, Gf.Quatf(1), 0.0), (2, turned, 0.5)):
        animation.CreateRotationsAttr().Set([Gf.Quatf(1), quaternion], time)
        animation.CreateTranslationsAttr().Set([(move, 0, 0), (0, 1, 0)], time)
    api = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    api.CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    mesh = UsdGeom.Mesh.Define(stage, f"{root}/Sleeve")
    UsdGeom.XformCommonAPI(mesh).SetTranslate((5, 0, 0))
    mesh.CreatePointsAttr(POINTS)
    mesh.CreateFaceVertexCountsAttr([4, 4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3, 3, 2, 4, 5])
    mesh.CreateSubdivisionSchemeAttr("none")
    bound = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    bound.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    bound.CreateGeomBindTransformAttr(Gf.Matrix4d(1).SetTranslate((0, 0.1, 0)))
    bound.CreateJointIndicesPrimvar(False, 2).Set([0, 1] * 6)
    bound.CreateJointWeightsPrimvar(False, 2).Set([1, 0, 1, 0, 0.5, 0.5, 0.5, 0.5, 0, 1, 0, 1])
    return mesh


def of_one_joint(mesh: UsdGeom.Mesh) -> None:
    """Rigid: one joint for the whole mesh."""
    bound = UsdSkel.BindingAPI(mesh)
    bound.CreateJointIndicesPrimvar(True, 1).Set([1])
    bound.CreateJointWeightsPrimvar(True, 1).Set([1.0])


def in_its_own_order(mesh: UsdGeom.Mesh) -> None:
    bound = UsdSkel.BindingAPI(mesh)
    bound.CreateJointsAttr(JOINTS[::-1])
    bound.CreateJointIndicesPrimvar(False, 2).Set([1, 0] * 6)


def by_dual_quaternions(mesh: UsdGeom.Mesh) -> None:
    UsdSkel.BindingAPI(mesh).CreateSkinningMethodAttr("dualQuaternion")


def with_blend_shapes(mesh: UsdGeom.Mesh) -> None:
    """A shape of two points with an inbetween, and one of all points, in another order than the
    animation's."""
    path = mesh.GetPath()
    stage = mesh.GetPrim().GetStage()
    bulge = UsdSkel.BlendShape.Define(stage, path.AppendChild("bulge"))
    bulge.CreateOffsetsAttr([(0, 0, 1)] * 2)
    bulge.CreatePointIndicesAttr([2, 3])
    half = bulge.CreateInbetween("half")
    half.SetWeight(0.5)
    half.SetOffsets([(0, 0, 3)] * 2)
    flat = UsdSkel.BlendShape.Define(stage, path.AppendChild("flat"))
    flat.CreateOffsetsAttr([(0, -0.1 * k, 0) for k in range(6)])
    bound = UsdSkel.BindingAPI(mesh)
    bound.CreateBlendShapesAttr(["bulge", "flat"])
    bound.CreateBlendShapeTargetsRel().SetTargets([bulge.GetPath(), flat.GetPath()])
    animation = UsdSkel.Animation(stage.GetPrimAtPath(path.GetParentPath().AppendPath("Skel/Anim")))
    animation.CreateBlendShapesAttr(["flat", "unused", "bulge"])
    for time, weights in ((1, [0, 0, 0]), (2, [0.4, 1, 0.7])):
        animation.CreateBlendShapeWeightsAttr().Set(weights, time)


def blended_alone(mesh: UsdGeom.Mesh) -> None:
    with_blend_shapes(mesh)
    for name in ("jointIndices", "jointWeights"):
        mesh.GetPrim().RemoveProperty(f"primvars:skel:{name}")


def mirrored(mesh: UsdGeom.Mesh) -> None:
    UsdGeom.XformCommonAPI(mesh).SetScale((-2, 1, 1))


def as_it_is(mesh: UsdGeom.Mesh) -> None:
    pass


SKINS = {
    "two joints and weights": as_it_is,
    "one joint for the whole mesh": of_one_joint,
    "joints in the mesh's own order": in_its_own_order,
    "dual quaternions": by_dual_quaternions,
    "blend shapes with inbetweens, then joints": with_blend_shapes,
    "blend shapes alone": blended_alone,
    "a mirrored mesh": mirrored,
}


def baked(stage: Usd.Stage, root: str = "/Body") -> Usd.Stage:
    """A copy of the stage that USD has posed."""
    copy = Usd.Stage.Open(stage.Flatten())
    assert UsdSkel.BakeSkinning(UsdSkel.Root(copy.GetPrimAtPath(root)), Gf.Interval(1, 2))
    return copy


def world(stage: Usd.Stage, path: str, time: float) -> np.ndarray:
    """(n, 3) points of a mesh in the world."""
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(path))
    matrix = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(mesh.GetPrim()))
    return np.array(mesh.GetPointsAttr().Get(time)) @ matrix[:3, :3] + matrix[3, :3]


@pytest.mark.parametrize("time", [1.0, 2.0])
@pytest.mark.parametrize("name", SKINS)
def test_a_mesh_is_posed_as_usd_bakes_it(tmp_path, name, time):
    stage = new_stage(tmp_path)
    SKINS[name](sleeve(stage))
    expected = world(baked(stage), "/Body/Sleeve", time)
    if time == 2:
        assert np.abs(expected - world(stage, "/Body/Sleeve", time)).max() > 0.1
    scene = read(stage, time_code=time)
    assert scene.notes == []
    [mesh] = scene.meshes
    assert mesh.points == pytest.approx(expected, abs=1e-5)


NORMALS = {
    # name: (interpolation, how many)
    "one a point": ("vertex", 6),
    "one a corner": ("faceVarying", 8),
    "one a face": ("uniform", 2),
    "one for all": ("constant", 1),
}


@pytest.mark.parametrize("name", NORMALS)
def test_authored_normals_turn_with_the_joints(tmp_path, name):
    interpolation, count = NORMALS[name]
    stage = new_stage(tmp_path)
    mesh = sleeve(stage)
    mesh.CreateNormalsAttr([(0.6, 0, 0.8)] * count)
    mesh.SetNormalsInterpolation(interpolation)
    [read_mesh] = read(stage, time_code=2.0).meshes
    # USD bakes normals of points, and every kind here holds the same one.
    mesh.CreateNormalsAttr([(0.6, 0, 0.8)] * 6)
    mesh.SetNormalsInterpolation("vertex")
    copy = baked(stage)
    posed = UsdGeom.Mesh(copy.GetPrimAtPath("/Body/Sleeve")).GetNormalsAttr().Get(2.0)
    expected = np.array(posed)[read_mesh.triangles]
    found = read_mesh.normals / np.linalg.norm(read_mesh.normals, axis=-1, keepdims=True)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    assert found == pytest.approx(expected, abs=1e-5)


def test_normals_that_blend_shapes_do_not_move_are_smoothed_with_a_note(tmp_path):
    stage = new_stage(tmp_path)
    mesh = sleeve(stage)
    mesh.CreateNormalsAttr([(0, 0, 1)] * 6)
    with_blend_shapes(mesh)
    assert read(stage, time_code=1.0).meshes[0].normals is not None
    scene = read(stage, time_code=2.0)
    assert scene.meshes[0].normals is None
    assert any("normals that its blend shapes do not move" in note for note in scene.notes)


def test_the_front_of_a_mirrored_mesh_stays_in_front(tmp_path):
    stage = new_stage(tmp_path)
    mirrored(sleeve(stage))
    at_rest, posed = (read(stage, time_code=t).meshes[0].triangles for t in (1.0, 2.0))
    assert (at_rest == posed).all()


def test_a_skeleton_that_is_instanced_poses_each_instance(tmp_path):
    stage = new_stage(tmp_path)
    with_blend_shapes(sleeve(stage, "/Body"))
    for k in range(2):
        parent = UsdGeom.Xform.Define(stage, f"/copy{k}")
        parent.AddTranslateOp().Set((10.0 * (k + 1), 0, 0))
        copy = stage.DefinePrim(f"/copy{k}/Body")
        copy.GetReferences().AddInternalReference("/Body")
        copy.SetInstanceable(True)
    expected = world(baked(stage), "/Body/Sleeve", 2.0)
    for instanced in (False, True):
        scene = with_copies(read(stage, time_code=2.0, instanced=instanced))
        for k, mesh in enumerate(sorted(scene.meshes, key=lambda m: m.points[:, 0].mean())):
            assert mesh.points == pytest.approx(expected + np.array([10.0 * k, 0, 0]), abs=1e-5)


def test_a_skeleton_in_a_prototype_of_an_instancer_poses_each_instance(tmp_path):
    stage = new_stage(tmp_path)
    sleeve(stage, "/Protos/Body")
    expected = world(baked(stage, "/Protos/Body"), "/Protos/Body/Sleeve", 2.0)
    stage.GetPrimAtPath("/Protos").SetSpecifier(Sdf.SpecifierOver)
    instancer = UsdGeom.PointInstancer.Define(stage, "/many")
    instancer.CreatePrototypesRel().SetTargets(["/Protos/Body"])
    instancer.CreatePositionsAttr([(0, 0, 0), (0, 0, 7)])
    instancer.CreateProtoIndicesAttr([0, 0])
    for instanced in (False, True):
        first, second = with_copies(read(stage, time_code=2.0, instanced=instanced)).meshes
        assert first.points == pytest.approx(expected, abs=1e-5)
        assert second.points == pytest.approx(expected + np.array([0, 0, 7]), abs=1e-5)


def test_the_skinned_panel_moves_from_frame_1_to_2_and_between():
    for time, x in ((None, 0.0), (1.0, 0.0), (1.5, 0.15), (2.0, 0.3)):
        scene = read_scene(SKINNED, time_code=time)
        assert scene.notes == []
        assert scene.bounds()[0][0] == pytest.approx(x)


def no_api(mesh: UsdGeom.Mesh) -> None:
    mesh.GetPrim().RemoveAPI(UsdSkel.BindingAPI)


def no_root(mesh: UsdGeom.Mesh) -> None:
    mesh.GetPrim().GetParent().SetTypeName("Xform")


def no_skeleton(mesh: UsdGeom.Mesh) -> None:
    UsdSkel.BindingAPI(mesh).GetSkeletonRel().SetTargets(["/nowhere"])


def too_few_influences(mesh: UsdGeom.Mesh) -> None:
    UsdSkel.BindingAPI(mesh).GetJointIndicesPrimvar().Set([0, 1])


def unknown_joint(mesh: UsdGeom.Mesh) -> None:
    UsdSkel.BindingAPI(mesh).GetJointIndicesPrimvar().Set([0, 7] * 6)


def other_points_of_a_shape(mesh: UsdGeom.Mesh) -> None:
    with_blend_shapes(mesh)
    shape = mesh.GetPrim().GetChild("bulge")
    UsdSkel.BlendShape(shape).GetPointIndicesAttr().Set([2, 99])


def no_bind_transforms(mesh: UsdGeom.Mesh) -> None:
    mesh.GetPrim().GetParent().GetChild("Skel").RemoveProperty("bindTransforms")


AT_REST = {
    # name: (what is wrong, words of the note)
    "the API is not applied": (no_api, "SkelBindingAPI is not in its apiSchemas"),
    "there is no SkelRoot": (no_root, "it lies below no SkelRoot"),
    "the skeleton is missing": (no_skeleton, "it has no skeleton"),
    "influences of too few points": (too_few_influences, "its joint influences do not fit"),
    "a joint that there is not": (unknown_joint, "it names joint 7 of 2"),
    "a blend shape of other points": (other_points_of_a_shape, "a blend shape moves point 99"),
    "no bind transforms": (no_bind_transforms, "has no bindTransforms for its joints"),
}


@pytest.mark.parametrize("name", AT_REST)
def test_what_cannot_be_posed_is_rendered_at_rest_with_a_note(tmp_path, name):
    damage, words = AT_REST[name]
    stage = new_stage(tmp_path)
    damage(sleeve(stage))
    scene = read(stage, time_code=2.0)
    assert any("/Body/Sleeve is skinned, but" in n and words in n for n in scene.notes)
    assert scene.meshes[0].points == pytest.approx(np.array(POINTS) + np.array([5, 0, 0]))


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e30])
def test_joints_without_a_finite_place_are_read(tmp_path, number):
    stage = new_stage(tmp_path)
    sleeve(stage).CreateNormalsAttr([(0, 0, 1)] * 6)
    animation = UsdSkel.Animation(stage.GetPrimAtPath("/Body/Skel/Anim"))
    animation.GetRotationsAttr().Set([Gf.Quatf(1), Gf.Quatf(number, 1, 0, 0)], 2.0)
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/Body/Skel"))
    assert len(read(stage, time_code=2.0).meshes) == 1
    UsdGeom.XformCommonAPI(skeleton).SetTranslate((number, 0, 0))
    scene = read(stage, time_code=2.0)
    assert len(scene.meshes) == (1 if np.isfinite(number) else 0)
    assert any(note.startswith("/Body/Sleeve has") for note in scene.notes)


def test_a_mesh_below_a_skel_root_that_nothing_moves_is_read_without_a_note(tmp_path):
    stage = new_stage(tmp_path)
    sleeve(stage)
    mesh = UsdGeom.Mesh.Define(stage, "/Body/Hat")
    mesh.CreatePointsAttr(POINTS[:3])
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    mesh.CreateSubdivisionSchemeAttr("none")
    scene = read(stage, time_code=2.0)
    assert scene.notes == []
    assert len(scene.meshes) == 2
