"""Tangents, new UVs, and the layer that carries both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.bake.layout.garment import garments, tiles_of
from fabricusd.bake.layout.mesh_layer import write_mesh_layer
from fabricusd.bake.layout.overlaps import refuse_overlaps
from fabricusd.bake.layout.tangents import corner_tangents
from fabricusd.bake.layout.unwrap import unwrapped
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric
from tests.bake.meshes import quad_scene

UNIT = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


@pytest.mark.parametrize(
    ("uv", "tangent", "sign"),
    [
        (UNIT, (1, 0, 0), 1),
        (UNIT * (-1, 1) + [1, 0], (-1, 0, 0), -1),
        (UNIT[:, ::-1], (0, 1, 0), -1),
    ],
)
def test_tangents_run_along_u_and_the_sign_gives_v(uv, tangent, sign):
    one = garments(quad_scene(Fabric(), uv=uv))[0]
    found = corner_tangents(one)
    assert np.allclose(found[..., :3], tangent)
    assert np.allclose(found[..., 3], sign)
    # The bitangent is the direction of growing v.
    bitangent = found[..., 3:] * np.cross(one.normals, found[..., :3])
    corners = one.points[one.triangles]
    step = np.einsum("mij,mkj->mik", corners - corners[:, :1], bitangent[:, :1])[..., 0]
    assert np.allclose(step * 100, one.uv[..., 1] - one.uv[:, :1, 1], atol=1e-9)


def test_the_layer_holds_indexed_uvs_and_tangents(tmp_path):
    one = replace(garments(quad_scene(Fabric()))[0], name="Quad")
    write_mesh_layer(tmp_path / "a.usdc", one, "Z")
    stage = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    for name, size in (("st", 2), ("tangents", 4), ("normals", 3)):
        primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar(name)
        assert primvar.IsIndexed()
        assert primvar.GetInterpolation() == "faceVarying"
        assert np.array(primvar.ComputeFlattened()).shape == (6, size)


def cylinder(rings: int = 12, height: float = 0.3, radius: float = 0.05):
    """A tube along z without UVs."""
    phi = np.arange(rings) * 2 * np.pi / rings
    low = np.stack((radius * np.cos(phi), radius * np.sin(phi), np.zeros(rings)), axis=1)
    points = np.concatenate((low, low + np.array([0, 0, height])))
    tri = []
    for k in range(rings):
        n = (k + 1) % rings
        tri += [[k, n, rings + n], [k, rings + n, rings + k]]
    return points, np.array(tri)


def test_a_mesh_without_uvs_is_unwrapped_with_the_warp_along_the_axis():
    points, tri = cylinder()
    scene = quad_scene(Fabric())
    scene.meshes[0] = replace(
        scene.meshes[0], points=points, triangles=tri, uv=None, material=np.zeros(len(tri), int)
    )
    one = unwrapped("z", None, scene, scene.meshes[0])
    assert one is not None
    one = replace(one, name="tube")
    corners = one.points[one.triangles]
    for k, lay in enumerate(one.lays):
        mine = one.lay == k
        weave = one.uv[mine] @ lay.matrix.T
        rise = corners[mine][:, 1:, 2] - corners[mine][:, :1, 2]
        picks = weave[:, 1:, 1] - weave[:, :1, 1]
        ends = weave[:, 1:, 0] - weave[:, :1, 0]
        high = np.abs(rise) > 0.1
        # Along the axis picks are counted, in the fabric's own density, and no ends.
        assert np.allclose(picks[high] / rise[high], lay.fabric.weft.density, rtol=0.05)
        straight = high & (np.linalg.norm((corners[mine][:, 1:] - corners[mine][:, :1])[..., :2],
                                          axis=-1) < 1e-9)  # fmt: skip
        assert np.abs(ends[straight]).max(initial=0.0) < 0.05 * np.abs(picks[high]).max()


def test_unwrapping_takes_overlaps_away(tmp_path):
    scene = quad_scene(Fabric())
    mesh = scene.meshes[0]
    scene.meshes[0] = replace(mesh, uv=np.stack((mesh.uv[0], mesh.uv[0])))
    one = unwrapped("y", None, scene, scene.meshes[0])
    assert one is not None
    refuse_overlaps(replace(one, name="q"), tiles_of(one, False), 256, tmp_path)


def test_a_file_without_uvs_says_so_and_is_baked_when_unwrapped(tmp_path):
    points, tri = cylinder()
    lines = [f"v {x} {y} {z}" for x, y, z in points.tolist()]
    lines += ["f " + " ".join(str(k + 1) for k in t) for t in tri.tolist()]
    scene = tmp_path / "tube.obj"
    scene.write_text("\n".join(lines) + "\n")
    linen = Binding(fabric=Fabric(name="Plain"))
    settings = Settings(resolution=64, maps=("opacity",))
    with pytest.raises(FabricError, match="has no UVs for its fabric"):
        bake(scene, tmp_path / "a", settings, fabric=linen)
    result = bake(scene, tmp_path / "b", replace(settings, unwrap="z"), fabric=linen)
    assert any("shells, warp along z" in note for note in result.notes)
    assert (tmp_path / "b" / f"{result.garments[0].name}.usdc").is_file()
    with pytest.raises(FabricError, match="must be one of x, y, z"):
        bake(scene, tmp_path / "c", replace(settings, unwrap="w"), fabric=linen)
