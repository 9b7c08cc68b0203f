"""What is refused before a bake, and what shares a texture set."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.bake.layout.garment import fitted, garments, lay_of, resolution_for, tiles_of
from fabricusd.bake.layout.overlaps import refuse_overlaps
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric
from fabricusd.scene.scene import FabricSurface, Scene
from tests.bake.meshes import quad_mesh, quad_scene

UNIT = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"uv": None}, "has no UVs"),
        ({"uv": np.full((2, 3, 2), np.nan)}, "2 of 2 triangles with UVs that are not finite"),
        ({"points": np.full((4, 3), np.inf)}, "points that are not finite"),
        ({"uv": np.zeros((2, 3, 2))}, "UVs of zero area"),
    ],
)
def test_a_mesh_that_cannot_be_baked_is_refused_in_one_line(change, words):
    scene = quad_scene(Fabric())
    scene.meshes[0] = replace(scene.meshes[0], **change)
    with pytest.raises(FabricError, match=words) as error:
        garments(scene)
    assert "/Quad" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_scene_without_fabric_and_an_unknown_mesh_are_refused():
    with pytest.raises(FabricError, match="wears no fabric"):
        garments(Scene())
    with pytest.raises(FabricError, match="must be one of /Quad"):
        garments(quad_scene(Fabric()), "/Nothing")


def test_instances_of_a_mesh_are_baked_once():
    scene = quad_scene(Fabric())
    scene.meshes.append(quad_mesh(path="/Copy", move=3.0))
    found = garments(scene)
    assert len(found) == 1
    assert found[0].copies == ("/Quad", "/Copy")


def test_two_fabrics_of_one_name_are_told_apart():
    scene = quad_scene(Fabric(name="Cloth"))
    for k, opaque in enumerate((True, False), start=1):
        binding = Binding(fabric=Fabric(name="Cloth", opaque=opaque), threads_per_uv=(8.0, 8.0))
        scene.materials.append(FabricSurface(binding=binding))
        mesh = quad_mesh(path=f"/Other{k}", move=3.0 * k)
        scene.meshes.append(replace(mesh, material=np.full(2, k, np.int32)))
    found = [one.lays[0].fabric for one in garments(scene)]
    assert [cloth.name for cloth in found] == ["Cloth", "Cloth_2", "Cloth"]
    assert [cloth.opaque for cloth in found] == [False, True, False]


def test_mirrored_triangles_are_counted():
    mirrored = UNIT * (-1, 1) + [1, 0]
    assert not garments(quad_scene(Fabric()))[0].mirrored.any()
    assert garments(quad_scene(Fabric(), uv=mirrored))[0].mirrored.all()


@pytest.mark.parametrize(
    ("uv", "numbers"),
    [
        (UNIT, [1001]),
        (UNIT + np.array([1, 0]), [1002]),
        (UNIT * 0.5 + [9.5, 10.5], None),
        (UNIT + np.array([8, 10]), [1109]),
        (UNIT * 2, [1001, 1002, 1011, 1012]),
        (UNIT - (0.5, 0), None),
    ],
)
def test_udim_tiles_and_their_borders(uv, numbers):
    one = garments(quad_scene(Fabric(), uv=uv))[0]
    if numbers is None:
        with pytest.raises(FabricError, match="tiles 1001 to 1109"):
            tiles_of(one, True)
    else:
        assert list(tiles_of(one, True)) == numbers


def test_uvs_outside_the_unit_square_ask_for_tiles_or_fitting():
    one = garments(quad_scene(Fabric(), uv=UNIT * 2))[0]
    with pytest.raises(FabricError, match="--udim"):
        tiles_of(one, False)
    fit = fitted(one)
    assert list(tiles_of(fit, False)) == [1001]
    # The same cloth lies under the same corner.
    for k in range(2):
        before = one.uv[k] @ one.lays[0].matrix.T + one.lays[0].offset
        after = fit.uv[k] @ fit.lays[0].matrix.T + fit.lays[0].offset
        assert np.allclose(before, after, atol=1e-9)


def test_overlaps_are_refused_with_a_picture(tmp_path):
    scene = quad_scene(Fabric())
    mesh = scene.meshes[0]
    scene.meshes[0] = replace(mesh, uv=np.stack((mesh.uv[0], mesh.uv[0])))
    one = garments(scene)[0]
    with pytest.raises(FabricError, match="first triangles 0 and 1"):
        refuse_overlaps(one, tiles_of(one, False), 128, tmp_path)
    assert (tmp_path / "Quad.overlaps.1001.png").stat().st_size > 0


def test_a_hundred_subsets_keep_their_fabrics():
    grid = 10
    tri, uv, points = [], [], []
    for k in range(grid * grid):
        x, y = k % grid, k // grid
        base = (UNIT + np.array([x, y])) / grid
        points += [(*p, 0.0) for p in base]
        for a in ((0, 1, 2), (0, 2, 3)):
            tri.append([4 * k + c for c in a])
            uv.append(base[list(a)])
    fabrics = [Fabric(name=f"F{k}") for k in range(100)]
    mesh = replace(
        quad_mesh(),
        points=np.array(points),
        triangles=np.array(tri),
        uv=np.array(uv),
        material=np.repeat(np.arange(100), 2).astype(np.int32),
    )
    surfaces = [FabricSurface(binding=Binding(fabric=f, threads_per_uv=(8, 8))) for f in fabrics]
    one = garments(Scene(meshes=[mesh], materials=surfaces))[0]
    assert [lay.fabric.name for lay in one.lays] == [f.name for f in fabrics]
    assert np.array_equal(one.lay, np.repeat(np.arange(100), 2))


def test_a_lay_is_the_binding_as_an_affine_map_even_far_out():
    binding = Binding(
        fabric=Fabric(), threads_per_uv=(97.0, 41.0), rotation=0.4, offset=(0.25, -3.5)
    )
    lay = lay_of(binding, 0.0)
    uv = np.random.default_rng(0).random((100, 2)) * 1e4
    assert np.allclose(uv @ lay.matrix.T + lay.offset, binding.weave_coordinates(uv), atol=1e-6)
    assert np.allclose(lay.along.T @ lay.along, np.eye(2), atol=1e-12)


def test_texels_per_thread_choose_the_resolution():
    found = garments(quad_scene(Fabric(), 100.0))
    assert resolution_for(found, 4.0) == 512
    with pytest.raises(FabricError, match="above 0"):
        resolution_for(found, 0.0)


def test_the_fingerprint_does_not_depend_on_how_numpy_prints():
    scene = quad_scene(Fabric())
    one = garments(scene)[0]
    before = one.fingerprint
    with np.printoptions(legacy="1.13"):
        assert one.fingerprint == before
