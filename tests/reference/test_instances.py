"""A picture of instances is the picture of their copies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from fabricusd.reference import integrator
from fabricusd.reference.render import render_scene
from fabricusd.scene.scene import Camera, Scene
from fabricusd.scene.studio import looking
from fabricusd.scene.usd import placed_meshes
from tests.reference.stages import bind_fabric, new_stage, read, square

SIZE = 48
LAYERS = ("beauty", "normal", "tangent", "uv", "depth")


def wave(stage: Usd.Stage, path: str, *, normals: bool = True, side: int = 9) -> UsdGeom.Mesh:
    """A curved sheet, a metre wide, whose grain turns."""
    across = np.linspace(-0.5, 0.5, side)
    x, z = (grid.ravel() for grid in np.meshgrid(across, across))
    mesh = UsdGeom.Mesh.Define(stage, path)
    y = 0.1 * np.sin(5 * x + 1) * np.cos(4 * z)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.stack((x, y, z), 1).astype(np.float32)))
    at = np.arange(side * side).reshape(side, side)
    quads = np.stack((at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]), -1).reshape(-1, 4)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(quads), 4))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.ravel().astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr("none")
    if normals:
        slope = np.stack(
            (-0.5 * np.cos(5 * x + 1) * np.cos(4 * z), np.ones_like(x),
             0.4 * np.sin(5 * x + 1) * np.sin(4 * z)), 1,
        )  # fmt: skip
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(slope.astype(np.float32)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    uv = np.stack((x + 0.3 * z, z - 0.2 * x), 1).astype(np.float32)
    UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    ).Set(Vt.Vec2fArray.FromNumpy(uv))
    return mesh


def hidden(stage: Usd.Stage, path: str) -> None:
    """Makes a prim the place of prototypes, which are not seen themselves."""
    stage.GetPrimAtPath(path).SetSpecifier(Sdf.SpecifierOver)


def native(stage: Usd.Stage, path: str, source: str, *moves) -> Usd.Prim:
    prim = stage.DefinePrim(path, "Xform")
    prim.GetReferences().AddInternalReference(source)
    prim.SetInstanceable(True)
    for name, value in moves:
        getattr(UsdGeom.Xformable(prim), f"Add{name}Op")().Set(value)
    return prim


def natives(stage, *moves):
    """Three instances of one mesh; the second is moved as asked."""
    wave(stage, "/Protos/sheet/body")
    bind_fabric(stage, stage.GetPrimAtPath("/Protos/sheet"))
    hidden(stage, "/Protos")
    native(stage, "/one", "/Protos/sheet", ("Translate", (-1.3, 0, 0)))
    native(stage, "/two", "/Protos/sheet", *moves)
    native(stage, "/three", "/Protos/sheet", ("Translate", (1.3, 0, 0.3)), ("RotateY", 75.0))
    state_scale(stage)


def scale_of(stage) -> Usd.Attribute:
    sheet = stage.GetPrimAtPath("/Protos/sheet")
    return sheet.GetAttribute("fabric:binding:threadsPerUnit")


def state_scale(stage):
    """Gives the fabric a scale of its own, so that instances of all sizes share their weave."""
    scale_of(stage).Set(Gf.Vec2d(40, 40))


def turned(stage):
    natives(stage, ("Translate", (0, 0.2, 0.1)), ("RotateXYZ", (20, 30, -50)))


def stretched(stage):
    natives(stage, ("RotateXYZ", (20, 30, 0)), ("Scale", (0.6, 1.5, 1.0)))


def sheared(stage):
    natives(
        stage, ("Transform", Gf.Matrix4d(1, 0.2, 0, 0, 0, 1, 0.5, 0, 0.4, 0, 0.8, 0, 0, 0, 0, 1))
    )


def mirrored(stage):
    natives(stage, ("RotateXYZ", (20, 30, 10)), ("Scale", (-1, 1, 1)))


def mirrored_first(stage):
    natives(stage, ("RotateXYZ", (20, 30, 10)))
    UsdGeom.Xformable(stage.GetPrimAtPath("/one")).AddScaleOp().Set((1, -1, 1))


def measured(stage):
    """Of a fabric without a scale, smaller instances have fewer threads."""
    turned(stage)
    scale_of(stage).Clear()
    native(stage, "/small", "/Protos/sheet", ("Translate", (0, 0, 1)), ("Scale", (0.5, 0.5, 0.5)))
    native(stage, "/also", "/Protos/sheet", ("Translate", (1, 0, 1)), ("Scale", (0.5, 0.5, 0.5)))


def among_others(stage):
    """Instances of several meshes and surfaces, beside an ordinary mesh."""
    wave(stage, "/Protos/sheet/body")
    bind_fabric(stage, stage.GetPrimAtPath("/Protos/sheet/body"), "rayon_shantung")
    UsdGeom.XformCommonAPI(wave(stage, "/Protos/sheet/lining", normals=False)).SetTranslate(
        (0, -0.2, 0)
    )
    button = square(stage, "/Protos/sheet/button")
    UsdGeom.XformCommonAPI(button).SetScale((0.1, 0.1, 0.1))
    UsdGeom.XformCommonAPI(button).SetTranslate((0, 0.15, 0))
    button.CreateDisplayColorAttr([(0.8, 0.1, 0.1)])
    hidden(stage, "/Protos")
    native(stage, "/one", "/Protos/sheet", ("Translate", (-0.7, 0, 0)), ("RotateX", 40.0))
    native(stage, "/two", "/Protos/sheet", ("Translate", (0.7, 0, 0)), ("RotateZ", 30.0))
    floor = square(stage, "/floor")
    UsdGeom.XformCommonAPI(floor).SetTranslate((0, -0.6, 0))


def scattered(stage, path="/many", prototypes=("/Protos/sheet",)):
    many = UsdGeom.PointInstancer.Define(stage, path)
    many.CreatePrototypesRel().SetTargets(list(prototypes))
    many.CreatePositionsAttr([(-1, 0, 0), (0, 0, 0.4), (1, 0, 0), (0, 1, -1), (5, 5, 5)])
    many.CreateOrientationsfAttr([Gf.Quatf(1), Gf.Quatf(0.8, 0.6, 0, 0), Gf.Quatf(0.6, 0, 0, 0.8),
                                  Gf.Quatf(1), Gf.Quatf(1)])  # fmt: skip
    many.CreateScalesAttr([(1, 1, 1), (0.7, 0.7, 0.7), (1, -1, 1), (1, 1, 1), (1, 1, 1)])
    many.CreateProtoIndicesAttr([k % len(prototypes) for k in range(5)])
    many.CreateIdsAttr([10, 11, 12, 13, 14])
    many.CreateInvisibleIdsAttr([14])
    return many


def point_instancer(stage):
    wave(stage, "/Protos/sheet")
    bind_fabric(stage, stage.GetPrimAtPath("/Protos/sheet"))
    state_scale(stage)
    square(stage, "/Protos/tile")
    UsdGeom.XformCommonAPI(stage.GetPrimAtPath("/Protos/tile")).SetScale((0.3, 0.3, 0.3))
    hidden(stage, "/Protos")
    scattered(stage, prototypes=("/Protos/sheet", "/Protos/tile"))


def nested(stage):
    """An instancer in a prototype of another, and both in a native instance."""
    wave(stage, "/Protos/sheet")
    bind_fabric(stage, stage.GetPrimAtPath("/Protos/sheet"))
    state_scale(stage)
    hidden(stage, "/Protos")
    UsdGeom.XformCommonAPI(scattered(stage, "/Group/many")).SetScale((0.4, 0.4, 0.4))
    hidden(stage, "/Group")
    outer = scattered(stage, "/Outer/all", ("/Group",))
    outer.GetInvisibleIdsAttr().Set([11, 14])
    hidden(stage, "/Outer")
    native(stage, "/one", "/Outer", ("RotateY", 20.0))
    native(stage, "/two", "/Outer", ("Translate", (0, 0, -2.0)))


CASES = {
    # name: (the stage, prototypes that are placed, instances)
    "turned": (turned, 1, 3),
    "one is stretched": (stretched, 1, 2),
    "one is sheared": (sheared, 1, 2),
    "mirrored": (mirrored, 1, 3),
    "the first is mirrored": (mirrored_first, 1, 3),
    "a fabric measured on two sizes": (measured, 2, 5),
    "several meshes and surfaces": (among_others, 3, 2),
    "a point instancer with hidden instances": (point_instancer, 2, 4),
    "nested": (nested, 1, 24),
}


def drawn(scene: Scene, **settings):
    """A picture from obliquely above."""
    low, high = scene.bounds()
    middle, extent = 0.5 * (low + high), float(np.linalg.norm(high - low))
    eye = middle + extent * np.array([0.4, 1.0, 0.7])
    frame = looking(eye, middle, np.array([0.0, 1.0, 0.0]))
    camera = Camera(frame=frame, aperture=(0.03, 0.03), focal_length=0.05)
    own = replace(scene, meshes=[*scene.meshes], lights=[*scene.lights], camera=camera)
    settings = {"aovs": LAYERS, "spp": 4, "max_bounces": 2, **settings}
    return render_scene(own, width=SIZE, height=SIZE, **settings)


def off(a, b, layer: str) -> float:
    """The share of pixels that differ by more than rounding."""
    scale = max(float(np.abs(b.layers[layer]).mean()), 0.05)
    difference = np.abs(a.layers[layer] - b.layers[layer]).max(axis=-1)
    return float((difference > 2e-3 * scale).mean())


@pytest.mark.parametrize("name", CASES)
def test_a_picture_of_instances_is_that_of_copies(tmp_path, name):
    make, prototypes, instances = CASES[name]
    stage = new_stage(tmp_path)
    make(stage)
    copied, placed = read(stage), read(stage, instanced=True)
    shared = [mesh for mesh in placed.meshes if mesh.placements is not None]
    assert (len(shared), placed.instances) == (prototypes, instances)
    assert all(mesh.placements is None for mesh in copied.meshes)
    assert np.allclose(placed.bounds(), copied.bounds(), atol=1e-6)
    a, b = (drawn(scene) for scene in (placed, copied))
    assert (b.layers["beauty"][..., 3] > 0).mean() > 0.1
    # A path that meets an edge on the other side goes elsewhere: few do.
    assert max(off(a, b, layer) for layer in LAYERS) < 0.02
    assert a.layers["beauty"].mean() == pytest.approx(b.layers["beauty"].mean(), rel=1e-3)


@pytest.mark.parametrize("make", [stretched, sheared])
def test_many_shapes_of_a_mesh_are_carried(tmp_path, monkeypatch, make):
    monkeypatch.setattr(placed_meshes, "MOST_SHAPED", 0)
    stage = new_stage(tmp_path)
    make(stage)
    placed = read(stage, instanced=True)
    assert placed.instances == 3
    assert any("is smoothed before its instances stretch it" in note for note in placed.notes)
    a, b = drawn(placed), drawn(read(stage))
    assert max(off(a, b, layer) for layer in ("normal", "uv", "depth")) < 0.001
    # Grain is averaged over the corners before it is stretched.
    assert np.abs(a.layers["tangent"] - b.layers["tangent"]).mean() < 1e-3
    assert a.layers["beauty"].mean() == pytest.approx(b.layers["beauty"].mean(), rel=1e-3)


@pytest.mark.parametrize("name", ["the first is mirrored", "nested"])
def test_close_to_uneven_threads_and_through_gaps_it_is_the_same(tmp_path, name):
    stage = new_stage(tmp_path)
    CASES[name][0](stage)
    placed, copied = (
        drawn(read(stage, instanced=instanced), level="thread", max_bounces=3)
        for instanced in (True, False)
    )
    # The place within a thread is a thousandth of a UV: rounding moves it across an edge at times.
    assert off(placed, copied, "beauty") < 0.1
    assert placed.layers["beauty"].mean() == pytest.approx(copied.layers["beauty"].mean(), rel=2e-3)


def test_light_falls_through_instances_as_through_copies(tmp_path):
    stage = new_stage(tmp_path)
    tile = square(stage, "/Protos/tile")
    tile.CreateDisplayOpacityAttr([0.4])
    hidden(stage, "/Protos")
    scattered(stage, prototypes=("/Protos/tile",))
    UsdGeom.XformCommonAPI(square(stage, "/floor")).SetTranslate((0, -1.2, 0))
    placed, copied = (drawn(read(stage, instanced=instanced)) for instanced in (True, False))
    assert off(placed, copied, "beauty") < 0.02
    assert placed.layers["beauty"].mean() == pytest.approx(copied.layers["beauty"].mean(), rel=1e-3)


@pytest.mark.parametrize("name", ["the first is mirrored", "one is sheared", "nested"])
def test_instances_become_copies_where_embree_cannot_place_them(tmp_path, monkeypatch, name):
    stage = new_stage(tmp_path)
    CASES[name][0](stage)
    placed = read(stage, instanced=True)
    monkeypatch.setattr(integrator, "has_instances", lambda: False)
    a, b = drawn(placed), drawn(read(stage))
    assert a.metadata["fabricusd:instances"] == 0
    assert max(off(a, b, layer) for layer in LAYERS) < 0.02
