"""`material --near`, from the bake to the look."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from materials.near import swatches
from materials.near.swatches import write_square
from pxr import Usd, UsdUtils

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.errors import FabricError
from fabricusd.materials import recipes
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings
from fabricusd.materials.targets.blender.addon import looks
from fabricusd.schema import load


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Bakes of a square of linen, of few threads and of many."""
    found = {}
    for name, threads in (("fine", 8.0), ("coarse", 256.0)):
        folder = tmp_path_factory.mktemp(name)
        scene = write_square(folder / "square.usda", load("linen_plain"), threads)
        settings = BakeSettings(resolution=64, maps=swatches.MAPS)
        bake(scene, folder / "baked", settings, workers=1)
        found[name] = folder / "baked"
    return found


@pytest.fixture
def quick(monkeypatch):
    """Without the fits of other surfaces, which these tests do not read."""
    monkeypatch.setattr(recipes, "draw_texels", lambda *_: None)


def with_threads(path):
    """The one look of a stage that has threads."""
    (found,) = (one for one in looks.read(Usd.Stage.Open(str(path))) if one.threads)
    return found


def named(made):
    return sorted(path.name for path in made.files if "lobes" in path.name)


def test_a_bake_that_resolves_threads_gives_its_texels(folders, tmp_path, quick):
    made = write_materials(folders["fine"], tmp_path / "look.usda", Settings(surfaces=("lobes",)))
    assert named(made) == [
        f"Cloth.lobes_{end}.exr" for end in ("lean", "warp", "warp_tint", "weft", "weft_tint")
    ]
    found = with_threads(tmp_path / "look.usda")
    assert found.threads.matrix == ()
    assert not any("lobes of" in line and "threads" in line for line in made.remarks)


def test_any_other_bake_gives_one_repeat_and_a_remark(folders, tmp_path, quick):
    made = write_materials(folders["coarse"], tmp_path / "look.usda", Settings(surfaces=("lobes",)))
    assert named(made) == [f"Fabric.lobes_{end}.exr" for end in ("lean", "warp", "weft")]
    found = with_threads(tmp_path / "look.usda")
    assert found.threads.matrix == pytest.approx((256.0, 0.0, 0.0, 256.0, 0.0, 0.0))
    assert found.threads.repeat == (2.0, 2.0)
    told = "have even threads, one repeat of them: a texel of the bake spans 4.0 threads"
    assert sum(told in line for line in made.remarks) == 1


@pytest.mark.parametrize(("near", "count"), [("off", 0), ("texels", 0), ("repeat", 1)])
def test_what_is_asked_for_is_done_where_it_can_be(folders, tmp_path, quick, near, count):
    settings = Settings(surfaces=("lobes",), near=near)
    made = write_materials(folders["coarse"], tmp_path / "look.usda", settings)
    stage = Usd.Stage.Open(str(tmp_path / "look.usda"))
    assert sum(one.threads is not None for one in looks.read(stage)) == count
    told = any("are the cloth from afar: a texel of the bake spans" in x for x in made.remarks)
    assert told == (near == "texels")


def test_without_lobes_no_threads_are_written(folders, tmp_path, quick):
    made = write_materials(folders["fine"], tmp_path / "look.usda", Settings())
    assert named(made) == []


def test_a_package_holds_the_textures(folders, tmp_path, quick):
    package = tmp_path / "cloth.usdz"
    write_materials(
        folders["fine"], tmp_path / "look.usda",
        Settings(surfaces=("lobes",), targets={"usdz": package}),
    )  # fmt: skip
    names = [str(x) for x in UsdUtils.ComputeAllDependencies(str(package))[1]]
    assert sum("lobes_weft" in name for name in names) == 2
    found = with_threads(package)
    assert all("cloth.usdz[" in path for _, path in found.threads.files)


def test_an_unknown_source_of_threads_is_refused_before_any_work(folders, tmp_path):
    settings = Settings(surfaces=("lobes",), near="far")
    with pytest.raises(FabricError, match="near is 'far'; it must be one of auto, texels"):
        write_materials(folders["fine"], tmp_path / "look.usda", settings)
    assert not list(tmp_path.iterdir())


def test_an_asset_has_copies_of_the_textures(folders, tmp_path, quick):
    settings = Settings(surfaces=("lobes",), targets={"asset": tmp_path / "coat"})
    write_materials(folders["fine"], tmp_path / "look.usda", settings)
    shutil.rmtree(tmp_path / "look_maps")
    found = with_threads(tmp_path / "coat" / "coat.usda")
    for _, path in found.threads.files:
        assert (tmp_path / "coat") in Path(path).parents
        assert Path(path).is_file()
