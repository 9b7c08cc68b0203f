"""What the tracer shows of a look close up: its normal map, against the threads themselves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.fabric import Binding
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings
from fabricusd.quality.pictures import difference
from fabricusd.reference.render import render_scene
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import Scene
from fabricusd.schema import load, write_binding, write_fabric
from tests.appearance.presets import often
from tests.materials.scenes import MAPS

THREADS = 12.0
"""Threads to a unit of UV; the bake has 10.7 texels to each."""
SIZE = 64

SHELLS = {"plain": slice(0, SIZE // 2), "mirrored": slice(SIZE // 2, SIZE)}
"""Columns of the picture."""

PRESETS = {
    # name: mean delta E 2000 to the threads, with the map at most and without it at least, and the
    # maps that are wrong enough to tell. Measured 5.5 to 5.8 and 6.4 to 6.6, 15.8 and 20.6. What
    # shot silk shows across a thread is the mean of its shadows, so green says nothing there.
    "linen_plain": (6.0, 6.3, ("flat", "with red inverted", "with green inverted")),
    "silk_shot": (16.2, 20.3, ("flat", "with red inverted")),
}

TURNED = {
    "flat": lambda n: np.broadcast_to(np.float32([0, 0, 1]), n.shape),
    "with red inverted": lambda n: n * np.float32([-1, 1, 1]),
    "with green inverted": lambda n: n * np.float32([1, -1, 1]),
}
"""Maps that are wrong."""


def write_cloth(path: Path, preset: str) -> Path:
    """Two squares beside each other, the second with u running backwards; a low sun from the right
    and the front; a camera above them that sees six threads of each."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/Cloth").GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/Cloth/Mesh")
    mesh.CreatePointsAttr([(x, 0, -y) for y in (0, 1) for x in (0, 0.5, 1)])
    mesh.CreateFaceVertexCountsAttr([4, 4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 4, 3, 1, 2, 5, 4])
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    st.Set([(0, 0), (0.5, 0), (0.5, 1), (0, 1), (1, 0), (0.5, 0), (0.5, 1), (1, 1)])
    write_fabric(stage, "/Cloth/Fabric", load(preset))
    binding = Binding(fabric=load(preset), threads_per_uv=(THREADS, THREADS))
    write_binding(mesh.GetPrim(), "/Cloth/Fabric", binding)
    sun = UsdLux.DistantLight.Define(stage, "/Cloth/Sun")
    sun.CreateIntensityAttr(5.0)
    sun.CreateAngleAttr(5.0)
    sun.CreateNormalizeAttr(True)
    UsdGeom.Xformable(sun).AddRotateXYZOp().Set(Gf.Vec3f(-30, 45, 0))
    UsdLux.DomeLight.Define(stage, "/Cloth/Dome").CreateIntensityAttr(0.1)
    camera = UsdGeom.Camera.Define(stage, "/Cloth/Camera")
    camera.CreateProjectionAttr("orthographic")
    # In tenths of a unit.
    camera.CreateHorizontalApertureAttr(10.0)
    camera.CreateVerticalApertureAttr(10.0)
    frame = UsdGeom.Xformable(camera)
    frame.AddTranslateOp().Set(Gf.Vec3d(0.5, 2 * 0.866, 0.5))
    frame.AddRotateXOp().Set(-60.0)
    stage.GetRootLayer().Save()
    return path


@pytest.fixture(scope="module", params=often(PRESETS, ("linen_plain",)))
def close_up(request, tmp_path_factory):
    """(name of the preset, picture of the threads, the scene of the look's variant `baked`)."""
    folder = tmp_path_factory.mktemp(request.param)
    cloth = write_cloth(folder / "cloth.usda", request.param)
    # Only level `thread` gives the normals the round of the threads.
    settings = BakeSettings(resolution=128, level="thread", maps=MAPS)
    bake(cloth, folder / "baked", settings, workers=1)
    # The fit takes a minute, and changes neither the map nor which of these pictures is nearer.
    write_materials(folder / "baked", folder / "look.usda", Settings(fitted=False), scene=cloth)
    stage = Usd.Stage.Open(str(folder / "look.usda"))
    stage.GetDefaultPrim().GetVariantSets().SetSelection("fabricLook", "baked")
    stage.GetRootLayer().Export(str(folder / "baked.usda"))
    look = read_scene(folder / "baked.usda")
    assert look.notes == []
    return request.param, shown(read_scene(cloth)), look


def shown(scene: Scene) -> np.ndarray:
    settings = {"width": SIZE, "height": SIZE, "spp": 64, "level": "thread"}
    return render_scene(scene, **settings).layers["beauty"][..., :3]


def with_map(scene: Scene, change) -> Scene:
    """`scene` with each normal map changed."""
    materials = []
    for surface in scene.materials:
        normal = surface.textures["normal"]
        changed = replace(normal, pixels=change(normal.pixels))
        materials.append(replace(surface, textures=surface.textures | {"normal": changed}))
    return replace(scene, materials=materials)


def test_the_normal_map_of_a_look_brings_it_nearer_to_its_threads(close_up):
    name, threads, look = close_up
    most, least_without, told = PRESETS[name]
    here = shown(look)
    wrong = {turn: shown(with_map(look, TURNED[turn])) for turn in told}
    for shell, columns in SHELLS.items():
        right = difference(here[:, columns], threads[:, columns]).delta_e_mean
        errors = {
            turn: difference(picture[:, columns], threads[:, columns]).delta_e_mean
            for turn, picture in wrong.items()
        }
        assert right < most, shell
        assert errors["flat"] > least_without, shell
        # Light from the wrong side; measured from 7.9 on for 5.8, and 25.7 for 15.8.
        assert min(errors.values()) > 1.05 * right, (shell, errors)
