"""Poses skinned meshes by UsdSkel's skeletons and blend shapes at one time.

USD's own queries deform the points. `UsdSkel.BakeSkinning` is not used: it poses meshes only at
times that have samples, and leaves instances at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdSkel, Vt

from fabricusd.errors import FabricError
from fabricusd.scene.scene import Scene
from fabricusd.scene.usd.value import array_of, note_types, usd_words

_BELOW_ROOTS = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
"""Which prims are asked: skinned meshes may be prototypes, which may lie below an `over`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pose:
    """A mesh's points after its blend shapes and its skeleton have moved them.

    points : (n, 3) float64 - in the skeleton's space, or in the mesh's where `skeleton` is None
    skeleton : the prim in whose space the points are; None for a mesh that has blend shapes alone
    influences : (n, k) int32 and (n, k) float32 - joints and their weights
    joints : transforms of those joints
    keeps_normals : False where blend shapes move the points: USD reads no normals of blend shapes
    """

    points: NDArray[np.float64]
    skeleton: Usd.Prim | None
    query: UsdSkel.SkinningQuery
    influences: tuple[NDArray[np.int32], NDArray[np.float32]] | None
    joints: list[Gf.Matrix4d]
    bind: Gf.Matrix4d
    keeps_normals: bool

    def normals(
        self, normals: NDArray[np.float64], triangles: NDArray[np.int64]
    ) -> NDArray[np.float64] | None:
        """(m, 3, 3) normals at rest -> (m, 3, 3) in the pose; None where they cannot be posed.

        normals : at the corners of `triangles`, which hold indices of points
        """
        if not self.keeps_normals:
            return None
        if self.influences is None:
            return normals
        corner = triangles.ravel()
        joints, weights = self.influences
        posed = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(normals.reshape(-1, 3), np.float32))
        done = UsdSkel.SkinNormals(
            self.query.GetSkinningMethod(),
            _for_normals(self.bind),
            Vt.Matrix3dArray([_for_normals(joint) for joint in self.joints]),
            Vt.IntArray.FromNumpy(np.ascontiguousarray(joints[corner]).ravel()),
            Vt.FloatArray.FromNumpy(np.ascontiguousarray(weights[corner]).ravel()),
            joints.shape[1],
            posed,
        )
        return np.array(posed, np.float64).reshape(normals.shape) if done else None


class Skeletons:
    """The skeletons of a stage and the meshes that they move, looked up when a mesh is read."""

    def __init__(self, time: Usd.TimeCode, scene: Scene) -> None:
        self.time, self.scene = time, scene
        self._cache = UsdSkel.Cache()
        self._bound: dict[Sdf.Path, dict[Sdf.Path, tuple[UsdSkel.SkinningQuery, Any]]] = {}
        self._poses: dict[Sdf.Path, Pose | None] = {}

    def pose(self, prim: Usd.Prim) -> Pose | None:
        """The pose of the mesh `prim`; None where it has none, with a note where it is skinned."""
        path = prim.GetPath()
        if path not in self._poses:
            self._poses[path] = self._find(prim) if _is_skinned(prim) else None
        return self._poses[path]

    def _find(self, prim: Usd.Prim) -> Pose | None:
        try:
            return self._posed(prim)
        except FabricError as error:
            problem = error.problem
        except Tf.ErrorException as error:
            problem = usd_words(error)
        self.scene.note(str(prim.GetPath()), f"is skinned, but {problem}; it is rendered at rest")
        return None

    def _posed(self, prim: Usd.Prim) -> Pose:
        query, skeleton = self._query(prim)
        where = str(prim.GetPath())
        at_rest = array_of(UsdGeom.Mesh(prim).GetPointsAttr(), self.time, self.scene, width=3)
        points = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(at_rest, np.float32))
        skeletal = self._cache.GetSkelQuery(UsdSkel.Skeleton(skeleton))
        if not skeletal:
            raise FabricError(where, f"its skeleton {skeleton.GetPath()} makes no sense")
        animation = skeletal.GetAnimQuery()
        self._note_types(prim, skeleton, *([animation.GetPrim()] if animation else []))
        blended = query.HasBlendShapes() and self._blend(prim, query, skeletal, points)
        if not query.HasJointInfluences():
            return Pose(
                points=np.array(points, np.float64), skeleton=None, query=query, influences=None,
                joints=[], bind=Gf.Matrix4d(1), keeps_normals=not blended,
            )  # fmt: skip
        joints = skeletal.HasBindPose() and skeletal.ComputeSkinningTransforms(self.time)
        if not joints:
            raise FabricError(
                where, f"its skeleton {skeleton.GetPath()} has no bindTransforms for its joints"
            )
        influences = query.ComputeVaryingJointInfluences(len(points), self.time)
        per_point = query.GetNumInfluencesPerComponent()
        if influences is None or len(influences[0]) != per_point * len(points) or not per_point:
            raise FabricError(where, f"its joint influences do not fit its {len(points)} points")
        mapped = _in_order(query, joints)
        numbers = np.array(influences[0], np.int32).reshape(-1, per_point)
        if len(points) and not 0 <= numbers.min() <= numbers.max() < len(mapped):
            bad = int(numbers.max()) if numbers.min() >= 0 else int(numbers.min())
            raise FabricError(where, f"it names joint {bad} of {len(mapped)}")
        if not query.ComputeSkinnedPoints(joints, points, self.time):
            raise FabricError(where, "USD cannot skin its points")
        return Pose(
            points=np.array(points, np.float64),
            skeleton=skeleton,
            query=query,
            influences=(numbers, np.array(influences[1], np.float32).reshape(-1, per_point)),
            joints=list(mapped),
            bind=query.GetGeomBindTransform(self.time),
            keeps_normals=not blended,
        )

    def _note_types(self, mesh: Usd.Prim, *others: Usd.Prim) -> None:
        """Note attributes of a wrong type: USD ignores them without a word."""
        note_types(mesh, r"(primvars:)?skel:.*", self.time, self.scene)
        shapes = UsdSkel.BindingAPI(mesh).GetBlendShapeTargetsRel().GetTargets()
        targets = [mesh.GetStage().GetPrimAtPath(path) for path in shapes]
        for prim in (*others, *filter(None, targets)):
            note_types(prim, ".*", self.time, self.scene)

    def _query(self, prim: Usd.Prim) -> tuple[UsdSkel.SkinningQuery, Usd.Prim]:
        """The mesh's skinning and its skeleton's prim, by the nearest SkelRoot that binds them."""
        if not prim.HasAPI(UsdSkel.BindingAPI):
            raise FabricError("", "SkelBindingAPI is not in its apiSchemas")
        roots = 0
        parent = prim.GetParent()
        while parent and not parent.IsPseudoRoot():
            if parent.IsA(UsdSkel.Root):
                roots += 1
                found = self._targets(parent).get(prim.GetPath())
                if found is not None:
                    return found
            parent = parent.GetParent()
        if not roots:
            raise FabricError("", "it lies below no SkelRoot")
        raise FabricError("", "it has no skeleton, or no joint influences or blend shapes that fit")

    def _targets(self, root: Usd.Prim) -> dict[Sdf.Path, tuple[UsdSkel.SkinningQuery, Usd.Prim]]:
        """What the skeletons below a SkelRoot move, by the path of each mesh."""
        path = root.GetPath()
        if path not in self._bound:
            which = Usd.TraverseInstanceProxies(_BELOW_ROOTS)
            self._cache.Populate(UsdSkel.Root(root), which)
            self._bound[path] = {
                query.GetPrim().GetPath(): (query, binding.GetSkeleton().GetPrim())
                for binding in self._cache.ComputeSkelBindings(UsdSkel.Root(root), which)
                for query in binding.GetSkinningTargets()
            }
        return self._bound[path]

    def _blend(
        self,
        prim: Usd.Prim,
        query: UsdSkel.SkinningQuery,
        skeletal: UsdSkel.SkeletonQuery,
        points: Vt.Vec3fArray,
    ) -> bool:
        """Move `points` by the mesh's blend shapes; False where every weight is 0."""
        animation = skeletal.GetAnimQuery()
        weights = animation.ComputeBlendShapeWeights(self.time) if animation else None
        if not weights:
            return False
        mapper = query.GetBlendShapeMapper()
        weights = mapper.Remap(weights) if mapper else weights
        if not np.any(np.array(weights)):
            return False
        shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(prim))
        if len(weights) != shapes.GetNumBlendShapes():
            raise FabricError(
                "", f"it has {shapes.GetNumBlendShapes()} blend shapes for {len(weights)} weights"
            )
        rows, offsets = shapes.ComputeBlendShapePointIndices(), shapes.ComputeSubShapePointOffsets()
        named = np.concatenate([np.zeros(0, np.int64), *(np.array(row) for row in rows if row)])
        if len(named) and not 0 <= named.min() <= named.max() < len(points):
            raise FabricError("", f"a blend shape moves point {named.max():g} of {len(points)}")
        if not shapes.ComputeDeformedPoints(
            *shapes.ComputeSubShapeWeights(weights), rows, offsets, points
        ):
            raise FabricError("", "USD cannot apply its blend shapes")
        return True


def _is_skinned(prim: Usd.Prim) -> bool:
    """Whether a mesh has blend shapes, or joint indices of its own or inherited."""
    if prim.GetAttribute("skel:blendShapes").HasAuthoredValue():
        return True
    joints = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("skel:jointIndices")
    return bool(joints) and joints.HasAuthoredValue()


def _in_order(query: UsdSkel.SkinningQuery, joints: Vt.Matrix4dArray) -> Vt.Matrix4dArray:
    """A skeleton's transforms, in the order of the mesh's joints."""
    mapper = query.GetJointMapper()
    if not mapper or mapper.IsIdentity():
        return joints
    still = Vt.Matrix4dArray([Gf.Matrix4d(1)] * len(query.GetJointOrder()))
    return mapper.RemapTransforms(joints, still)


def _for_normals(matrix: Gf.Matrix4d) -> Gf.Matrix3d:
    """The inverse transpose, which transforms normals; 0 where the matrix has no inverse."""
    turn = np.array(matrix.ExtractRotationMatrix())
    if not np.isfinite(turn).all():
        return Gf.Matrix3d(0)
    return Gf.Matrix3d(*np.linalg.pinv(turn).T.ravel().tolist())
