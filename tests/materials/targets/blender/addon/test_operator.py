"""`bpy.ops.import_scene.fabricusd`, in Blender's Python."""

from __future__ import annotations

import shutil

import pytest
from materials.scenes import bake_shirt
from pxr import Usd, UsdGeom

from fabricusd.materials import recipes
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings
from tests.materials.targets.blender.addon.blender import in_blender, interpreter

FILES = ("openpbr.usda", "openpbr.usdz", "lobes.usda", "lobes.usdz", "tiles.usda", "tiles.usdz")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The shirt as looks of both surfaces, as layers and as packages, and in UDIM tiles."""
    interpreter()
    made = tmp_path_factory.mktemp("looks")
    with pytest.MonkeyPatch.context() as patch:
        # Without the fits of other surfaces, which these tests do not read.
        patch.setattr(recipes, "draw_texels", lambda *_: None)
        for name, surface in (("openpbr", "openpbr"), ("lobes", "lobes"), ("tiles", "openpbr")):
            baked = made / ("tiles" if name == "tiles" else "plain") / "baked"
            if not baked.exists():
                baked.parent.mkdir()
                bake_shirt(baked.parent, udim=name == "tiles")
            settings = Settings(surfaces=(surface,), targets={"usdz": made / f"{name}.usdz"})
            write_materials(baked, made / f"{name}.usda", settings)
        write_materials(
            made / "plain" / "baked", made / "gltf.usda", Settings(surfaces=("gltf_pbr",))
        )
        write_materials(
            made / "plain" / "baked", made / "both.usda", Settings(surfaces=("openpbr", "lobes"))
        )
    return made


@pytest.fixture(scope="module")
def answers(folder, tmp_path_factory):
    """Of each file: what the import says, the groups it makes, and what is then in Blender."""
    steps = []
    for name in FILES:
        steps += [
            {"do": "clear"}, {"do": "bring", "path": str(folder / name)}, {"do": "groups"},
            {"do": "counts"},
        ]  # fmt: skip
    told = in_blender(tmp_path_factory.mktemp("blender"), *steps)
    return {name: told[4 * k + 1 : 4 * k + 4] for k, name in enumerate(FILES)}


@pytest.mark.parametrize("name", ["openpbr", "lobes", "tiles"])
def test_a_package_gives_the_groups_of_the_layer(answers, name):
    done, groups, counts = answers[f"{name}.usda"]
    assert done == {"done": ["FINISHED"]}
    assert answers[f"{name}.usdz"][0] == done
    assert answers[f"{name}.usdz"][1] == groups
    assert answers[f"{name}.usdz"][2]["images"] == counts["images"]


def test_a_fabric_is_one_group_and_its_textures(answers):
    groups = answers["openpbr.usda"][1]
    assert set(groups) == {
        "group Body_0", "group Body_1", "material Body_0", "material Body_1",
    }  # fmt: skip
    nodes, links = groups["material Body_0"]
    assert sum(kind == "ShaderNodeGroup" for kind, *_ in nodes) == 1
    files = {picture[0] for _, _, _, picture, _ in nodes if picture}
    assert "Body.base_color.exr" in files
    assert ["Group", "Surface", "Material Output", "Surface"] in links
    assert "group linen_plain" in answers["lobes.usda"][1]


def test_every_tile_is_in_the_image(answers):
    nodes, _ = answers["tiles.usdz"][1]["material Body_0"]
    tiles = [picture[2] for _, _, _, picture, _ in nodes if picture]
    assert tiles
    assert all(one == [1001, 1002] for one in tiles)


def test_one_step_back_takes_away_all_of_an_import(folder, tmp_path):
    push = {"do": "push", "message": "before"}
    steps = [push, {"do": "counts"}, {"do": "bring", "path": str(folder / "lobes.usda")}]
    steps += [{"do": "push", "message": "after"}, {"do": "counts"}, {"do": "undo"}, {"do": "redo"}]
    told = in_blender(tmp_path, *steps)
    before, after, undone, redone = told[1], told[4], told[5], told[6]
    # Two fabrics, and what they share: a lobe of each distribution, and how far it is seen from.
    assert (before["node_groups"], after["node_groups"]) == (0, 5)
    assert undone == before
    assert redone == after


def test_a_second_import_gets_materials_of_its_own(folder, tmp_path):
    once = {"do": "bring", "path": str(folder / "lobes.usda")}
    change = {"do": "change", "material": "Body_0", "Lobe 1 Tilt": 0.123}
    told = in_blender(tmp_path, once, change, once, {"do": "groups"})
    groups = told[-1]
    kept, new = (groups[f"material {name}"][0][0] for name in ("Body_0", "Body_0.001"))
    assert any(value == pytest.approx(0.123) for value in kept[4] if isinstance(value, float))
    assert not any(value == pytest.approx(0.123) for value in new[4] if isinstance(value, float))


@pytest.mark.parametrize(
    "surface", ["BEST", "PRINCIPLED", "LOBES"]
)  # fmt: skip
def test_a_look_with_both_surfaces_lets_the_user_choose(folder, tmp_path, surface):
    path = str(folder / "both.usda")
    told = in_blender(tmp_path, {"do": "bring", "path": path, "surface": surface}, {"do": "groups"})
    principled = [n for n in told[1]["group linen_plain"][0] if n[0] == "ShaderNodeBsdfPrincipled"]
    assert bool(principled) == (surface == "PRINCIPLED")


def test_what_cannot_be_imported_is_said_in_one_line(folder, tmp_path):
    (tmp_path / "broken.usda").write_text("#usda 1.0\ndef {")
    stage = Usd.Stage.CreateNew(str(tmp_path / "bare.usda"))
    UsdGeom.Cube.Define(stage, "/Cube")
    stage.GetRootLayer().Save()
    lobes = (folder / "lobes.usda").read_text()
    (tmp_path / "less.usda").write_text(lobes.replace("inputs:cycles:lobe0:color", "inputs:other"))
    names = ("none.usda", "broken.usda", "bare.usda", "a.obj", "less.usda")
    paths = [str(tmp_path / name) for name in names]
    last = str(folder / "lobes.usda")
    told = in_blender(
        tmp_path, *({"do": "bring", "path": path} for path in paths), {"do": "without_usd"},
        {"do": "bring", "path": last}, {"do": "counts"},
    )  # fmt: skip
    for path, one in zip((*paths, last), (*told[:5], told[6]), strict=True):
        assert one["error"].startswith(f"Error: {path} ")
        assert "\n" not in one["error"]
    assert "write one with 'fabricusd material'" in told[2]["error"]
    assert "lacks /Garment/FabricLooks/Body_0.inputs:cycles:lobe0:color;" in told[4]["error"]
    assert "this Blender was built without USD" in told[6]["error"]
    assert not any(told[-1].values())


def test_a_lost_texture_is_named_and_a_constant_replaces_it(folder, tmp_path):
    copy = tmp_path / "look"
    shutil.copytree(folder, copy)
    (copy / "openpbr_maps" / "Body.tangent.lay0.exr").unlink()
    path = str(copy / "openpbr.usda")
    told = in_blender(tmp_path, {"do": "bring", "path": path}, {"do": "groups"}, {"do": "said"})
    nodes, _ = told[1]["material Body_0"]
    assert not any(p and "tangent" in p[0] for _, _, _, p, _ in nodes)
    assert "Left out textures that cannot be read (Body.tangent.lay0.exr)" in told[2]


def test_a_surface_that_blender_has_not_stays_as_blender_imports_it(folder, tmp_path):
    path = str(folder / "gltf.usda")
    told = in_blender(tmp_path, {"do": "bring", "path": path}, {"do": "groups"}, {"do": "said"})
    assert told[0] == {"done": ["FINISHED"]}
    assert not any(name.startswith("group") for name in told[1])
    assert "the fit of Body_0, Body_1, which needs a look with --surface openpbr" in told[2]


def test_blender_installs_the_file_as_an_extension(folder, tmp_path):
    told = in_blender(tmp_path, {"do": "install", "package": str(tmp_path / "fabricusd_looks.zip")})
    assert told == [["bl_ext.user_default.fabricusd_looks"]]
