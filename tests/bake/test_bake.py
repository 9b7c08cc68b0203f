"""A bake from a scene to a folder: what it leaves behind, whole, and how it goes on."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fabricusd.bake import bake as module
from fabricusd.bake.bake import bake, plan
from fabricusd.bake.error.relight import RELIT, BakedSet, best_choice
from fabricusd.bake.job import Settings
from fabricusd.bake.texels import cell_table
from fabricusd.bake.work import assemble, checkpoint
from fabricusd.bake.work.scratch import Scratch
from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, even
from fabricusd.images.files import read_mip_level
from fabricusd.schema import load
from tests.bake.meshes import write_quad
from tests.bake.work.killed import leave_half_written

MAPS = ("normal", "thread_id", "lay", "base_color")
SMALL = Settings(resolution=512, maps=MAPS)


def sums(folder: Path) -> dict[str, str]:
    """Of the textures; not of the hidden files that a killed bake was still writing."""
    return {
        p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(folder.glob("[!.]*.exr"))
    }


@pytest.fixture(scope="module")
def square(tmp_path_factory):
    return write_quad(tmp_path_factory.mktemp("scene") / "square.obj")


@pytest.fixture(scope="module")
def linen():
    return Binding(fabric=load("linen_plain"), threads_per_uv=(64.0, 64.0))


@pytest.fixture(scope="module")
def whole(square, linen, tmp_path_factory):
    out = tmp_path_factory.mktemp("whole")
    return bake(square, out, SMALL, fabric=linen)


def test_textures_are_mip_mapped_and_the_scratch_is_gone(whole):
    name = whole.files[whole.garments[0].name]["normal"][1001]
    levels = [read_mip_level(whole.folder / name, k) for k in range(10)]
    assert [a.shape[0] for a in levels] == [512 >> k for k in range(10)]
    with pytest.raises(FabricError, match="no mip level 10"):
        read_mip_level(whole.folder / name, 10)
    assert not (whole.folder / ".bake").exists()


def test_the_manifest_names_what_was_made_of_what(whole, square):
    said = json.loads((whole.folder / "manifest.json").read_text())
    assert said["scene"]["sha256"] == hashlib.sha256(square.read_bytes()).hexdigest()
    files = next(iter(said["garments"].values()))["files"]
    assert set(files) == set(MAPS)
    for tiles in files.values():
        for one in tiles.values():
            data = (whole.folder / one["file"]).read_bytes()
            assert hashlib.sha256(data).hexdigest() == one["sha256"]
    report = json.loads((whole.folder / "report.json").read_text())
    assert report["cost"]["resolution"] == 512
    page = (whole.folder / "report.html").read_text()
    for heading in ("Garment", "Fabric", "Error", "Maps"):
        assert f"<h2>{heading}</h2>" in page
    for name in MAPS:
        assert f'alt="map {name}"' in page
    assert 'class="hero"' not in page  # nobody drew the garment


def test_the_number_of_workers_does_not_show(whole, square, linen, tmp_path):
    bake(square, tmp_path, SMALL, fabric=linen, workers=1)
    assert sums(tmp_path) == sums(whole.folder)


def test_a_set_is_relit_from_its_folder(square, linen, tmp_path):
    result = bake(square, tmp_path, Settings(resolution=128), fabric=linen)
    baked = BakedSet.load(tmp_path)
    name = result.garments[0].name
    picture = baked.relight(name, [linen.fabric], (0, 0, 1), (0, 0, 1), level=2)
    assert picture.shape == (32, 32, 3)
    assert picture.min() >= 0
    assert picture.mean() > 0.01
    with pytest.raises(FabricError, match="has no map"):
        baked.read(name, "nothing")


def test_a_stopped_bake_goes_on_and_ends_bit_identical(whole, square, linen, tmp_path, monkeypatch):
    written = []
    original = checkpoint.write_block

    def failing(path, *rest):
        if len(written) == 2:
            raise FabricError(str(path), "cannot be written: No space left on device")
        written.append(path)
        original(path, *rest)

    monkeypatch.setattr(checkpoint, "write_block", failing)
    with pytest.raises(FabricError, match="No space left"):
        bake(square, tmp_path, SMALL, fabric=linen, workers=1)
    assert not list(tmp_path.glob("*.exr"))
    again = []
    monkeypatch.setattr(
        checkpoint, "write_block", lambda path, *rest: (again.append(path), original(path, *rest))
    )
    bake(square, tmp_path, SMALL, fabric=linen, resume=True)
    assert len(again) == 2
    assert sums(tmp_path) == sums(whole.folder)


def test_a_block_that_was_damaged_is_made_again(whole, square, linen, tmp_path, monkeypatch):
    def stop(*_):
        raise FabricError("texture", "stopped")

    with monkeypatch.context() as patch:
        patch.setattr(assemble, "write_mip_exr", stop)
        with pytest.raises(FabricError, match="stopped"):
            bake(square, tmp_path, SMALL, fabric=linen)
    block = next((tmp_path / ".bake").glob("*/0_0.block"))
    block.write_bytes(block.read_bytes()[:-1000])
    bake(square, tmp_path, SMALL, fabric=linen, resume=True)
    assert sums(tmp_path) == sums(whole.folder)


def test_maps_of_sheets_without_tables_are_kept_in_blocks(square, linen, tmp_path, monkeypatch):
    """The way of cloths whose repeat is too large for a table; it ends in the same layout."""
    monkeypatch.setattr(cell_table, "MOST_PHASES", 0)
    linen = replace(linen, fabric=even(linen.fabric))
    result = bake(square, tmp_path / "a", SMALL, fabric=linen)
    again = bake(square, tmp_path / "b", SMALL, fabric=linen, workers=1)
    assert sums(again.folder) == sums(result.folder)
    name = result.files[result.garments[0].name]
    monkeypatch.undo()
    looked_up = bake(square, tmp_path / "c", SMALL, fabric=linen)
    for texture in MAPS:
        a, c = (read_mip_level(r.folder / name[texture][1001], 2) for r in (result, looked_up))
        assert np.abs(a - c).mean() < 0.02


def test_another_job_does_not_resume(square, linen, tmp_path):
    Scratch(tmp_path, "another", resume=False)
    with pytest.raises(FabricError, match="leave --resume out"):
        bake(square, tmp_path, SMALL, fabric=linen, resume=True)


@pytest.mark.exhaustive
def test_killed_at_random_moments_it_ends_bit_identical(whole, square, tmp_path):
    """kill -9 thirty times over the whole of a bake; only whole textures are ever seen."""
    program = (
        "import sys\n"
        "from fabricusd.bake.bake import Settings, bake\n"
        "from fabricusd.fabric import Binding\n"
        "from fabricusd.schema import load\n"
        "linen = Binding(fabric=load('linen_plain'), threads_per_uv=(64.0, 64.0))\n"
        f"settings = Settings(resolution=512, maps={MAPS!r})\n"
        "print('ready', flush=True)\n"
        "bake(sys.argv[1], sys.argv[2], settings, fabric=linen, resume=True)\n"
    )
    rng = np.random.default_rng(0)
    truth = sums(whole.folder)
    kills, target = 0, 30
    root = Path(__file__).resolve().parents[2]
    folder = tmp_path / "0"
    while kills < target:
        process = subprocess.Popen(
            [sys.executable, "-c", program, str(square), str(folder)],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": str(root)},
        )  # fmt: skip
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(float(rng.uniform(0.0, 2.0)))
        running = process.poll() is None
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        kills += running
        seen = sums(folder) if folder.exists() else {}
        assert all(truth[name] == value for name, value in seen.items())
        if not running:
            assert seen == truth
            assert not list(folder.glob(".*"))
            folder = tmp_path / str(kills)
    bake(
        square, folder, SMALL, resume=True,
        fabric=Binding(fabric=load("linen_plain"), threads_per_uv=(64.0, 64.0)),
    )  # fmt: skip
    assert sums(folder) == truth
    assert not list(folder.glob(".*"))


def test_what_a_kill_left_half_written_is_removed(whole, square, linen, tmp_path):
    leave_half_written(tmp_path / "square_obj.lay.exr")
    bake(square, tmp_path, SMALL, fabric=linen, resume=True)
    assert sums(tmp_path) == sums(whole.folder)
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (Settings(resolution=1000), "is 1000; it must be a power of two"),
        (Settings(resolution=32), "is 32"),
        (Settings(resolution=0, texels_per_thread=1e9), "bake fewer threads"),
        (Settings(maps=("colour",)), "is unknown"),
    ],
)
def test_settings_that_cannot_be_are_refused_before_anything_is_written(
    square, linen, tmp_path, settings, words
):
    with pytest.raises(FabricError, match=words):
        bake(square, tmp_path / "out", settings, fabric=linen)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_a_file_or_not_ours_is_refused(square, linen, tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(FabricError, match="is a file"):
        bake(square, file, SMALL, fabric=linen)
    with pytest.raises(FabricError, match="cannot be created"):
        bake(square, file / "below", SMALL, fabric=linen)


def test_a_disk_that_is_too_small_is_refused_before_the_work(square, linen, tmp_path, monkeypatch):
    monkeypatch.setattr(module.shutil, "disk_usage", lambda _: SimpleNamespace(free=1000))
    with pytest.raises(FabricError, match="GB left; the bake needs"):
        bake(square, tmp_path, SMALL, fabric=linen)


def test_udim_tiles_have_numbered_files(tmp_path, linen):
    scene = write_quad(tmp_path / "wide.obj", np.array([[0, 0], [2, 0], [2, 1], [0, 1]]))
    result = bake(
        scene, tmp_path / "out", Settings(resolution=64, maps=("opacity",), udim=True),
        fabric=linen,
    )  # fmt: skip
    files = next(iter(result.files.values()))["opacity"]
    assert set(files) == {1001, 1002}
    assert all(f".{number}.exr" in name for number, name in files.items())


def test_few_texels_per_thread_are_said_and_prefiltered(square, tmp_path):
    dense = Binding(fabric=load("linen_plain"), threads_per_uv=(4096.0, 4096.0))
    settings = Settings(resolution=64, maps=("opacity",))
    result = bake(square, tmp_path, settings, fabric=dense)
    assert any("texels per thread" in note for note in result.notes)
    name = next(iter(result.files.values()))["opacity"][1001]
    assert np.ptp(read_mip_level(result.folder / name)) == 0.0


@pytest.mark.exhaustive
def test_an_error_asked_for_chooses_the_resolution_and_the_maps(square, linen, tmp_path):
    """Texels, and maps to re-light, are the fewest that are within it: all cheaper ones are not."""
    result = bake(square, tmp_path, Settings(resolution=512, max_error=11.0), fabric=linen)
    assert result.reached(11.0)
    names = tuple(one.name for one in result.maps)
    chosen = best_choice(names)
    assert chosen in RELIT[:-1]
    assert "weft_spread" not in names
    assert "base_color" in names
    best = next(t for t in result.tried if (t.resolution, t.maps) == (result.resolution, chosen))
    cheaper = [t for t in result.tried if t.megabytes < best.megabytes]
    assert len(cheaper) >= 6
    assert all(t.point > 11.0 >= best.point for t in cheaper)
    picture = BakedSet.load(tmp_path).relight("square_obj", [linen.fabric], (0, 0, 1), (0, 0, 1))
    assert picture.mean() > 0.01


@pytest.mark.parametrize("file_format", ["png", "tiff"])
def test_16_bit_files_hold_the_values_of_the_exr(square, linen, tmp_path, file_format):
    """To half a step of 16 bits, ids exactly, four channels as they are."""
    maps = (
        "thread_id", "weave_coordinate", "albedo", "normal", "height", "opacity", "weft_share",
        "weft_angle",
    )  # fmt: skip
    of = {
        f: bake(
            square, tmp_path / f, Settings(resolution=64, maps=maps, file_format=f), fabric=linen
        )
        for f in ("exr", file_format)
    }
    exr, other = (BakedSet.load(tmp_path / f) for f in of)
    for name in maps:
        a, c = exr.read("square_obj", name), other.read("square_obj", name)
        said = other.manifest["garments"]["square_obj"]["files"][name]["1001"]["encoding"]
        steepest = 2.3 if said["transfer"] == "srgb" else 1.0
        limit = 0.0 if name == "thread_id" else 0.5001 * steepest * said["scale"] / 65535 + 1e-7
        assert np.abs(a - c).max() <= limit, name
    assert other.manifest["maps"]["albedo"]["color_space"] == "srgb_texture"
    with pytest.raises(FabricError, match="no mip level 1"):
        other.read("square_obj", "normal", 1)
    with pytest.raises(FabricError, match="must be one of exr"):
        bake(square, tmp_path / "jpg", Settings(file_format="jpg"), fabric=linen)


def test_the_error_of_each_map_is_stated(square, linen, tmp_path):
    """Half floats lose hardly anything, a texel's size a lot, and more texels less."""
    errors, linen = {}, replace(linen, fabric=even(linen.fabric))
    for resolution in (128, 512):
        folder = tmp_path / str(resolution)
        bake(square, folder, Settings(resolution=resolution), fabric=linen)
        said = json.loads((folder / "manifest.json").read_text())["garments"]["square_obj"]
        errors[resolution] = said["map_error"]
    for name in ("albedo", "normal", "height", "opacity", "horizon_00", "weft_angle"):
        coarse, fine = errors[128][name], errors[512][name]
        assert coarse["rounding"] < 0.02 * coarse["spread"]
        assert fine["texel"] < 0.15 * fine["spread"]
        assert fine["point"] < 0.8 * coarse["point"]
    assert errors[512]["thread_id"]["texel"] == 0.0
    assert errors[512]["normal"]["unit"] == "degrees"


def test_the_command_says_when_a_bound_is_not_reached(square, tmp_path, capsys):
    out = str(tmp_path / "out")
    common = ["bake", str(square), "--fabric", "linen_plain", "--maps", "opacity", "-o", out]
    assert main([*common, "--max-error", "0.01", "--resolution", "64"]) == 1
    shown = capsys.readouterr()
    assert "--max-error asks for 0.01" in shown.err
    assert "manifest.json" in shown.out
    assert main([*common, "--no-clobber"]) == 2


def test_a_dry_run_writes_nothing(square, linen, tmp_path, capsys):
    assert "64 texels" not in plan(square, SMALL, fabric=linen).lines[0]
    out = tmp_path / "out"
    assert main(["bake", str(square), "--fabric", "linen_plain", "-n", "-o", str(out)]) == 0
    assert "texels per thread" in capsys.readouterr().out
    assert not out.exists()
    assert main(["bake", "--list-maps"]) == 0
    assert "base_color" in capsys.readouterr().out


def test_the_towel_is_baked(shared_data, tmp_path):
    settings = Settings(resolution=256, fit=True, maps=("normal", "opacity"))
    result = bake(shared_data / "towel.obj", tmp_path, settings, fabric="linen_plain")
    assert result.finished
    assert len(list(tmp_path.glob("*.exr"))) == 2
