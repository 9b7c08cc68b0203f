"""The sample files are read by the commands that are printed beside them."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from fabricusd.samples.garment import skirt_obj
from fabricusd.samples.pictures import diamonds, rose, sky
from fabricusd.samples.write import SAMPLES, write_samples
from fabricusd.scene.read import read_scene
from fabricusd.schema import check, load


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("samples")
    write_samples(found)
    return found


def test_all_files_are_written(folder):
    assert sorted(p.name for p in folder.iterdir()) == sorted(SAMPLES)


def test_the_skirt_is_a_whole_garment(folder):
    scene = read_scene(folder / "skirt.obj", fabric="denim", units="cm")
    (mesh,) = scene.meshes
    corners = mesh.points[mesh.triangles]
    # Its rings are closed: every edge but those of waist and hem belongs to two triangles.
    edges = np.sort(
        np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]],
                        mesh.triangles[:, [2, 0]]]), axis=1
    )  # fmt: skip
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 1).sum() == 2 * 120
    assert set(counts) == {1, 2}
    # The outside is the front, and UVs are metres of cloth: little is stretched.
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outwards = corners.mean(axis=1) * (1.0, 0.0, 1.0)
    assert (np.einsum("ij,ij->i", normals, outwards) > 0).mean() > 0.8
    area = np.linalg.norm(normals, axis=1).sum()
    a, b = mesh.uv[:, 1] - mesh.uv[:, 0], mesh.uv[:, 2] - mesh.uv[:, 0]
    flat = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
    assert area == pytest.approx(flat, rel=0.05)
    assert 0.5 < np.ptp(mesh.points[:, 1]) < 0.6


def test_the_commands_beside_the_drawings_work(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("rose.png", "diamonds.png", "tweed.wif", "skirt.obj"):
        words = shlex.split(SAMPLES[name][2].format(folder / name))
        assert words[0] == "fabricusd"
        assert main(words[1:]) == 0, capsys.readouterr().err
        made = Path(words[words.index("-o") + 1])
        assert not [one for one in check(str(made)) if one.severity == "error"]
    assert load("diamonds.usda").weave.cells.shape == (24, 24)


def test_pictures_are_what_they_say():
    assert len(np.unique(rose().reshape(-1, 3), axis=0)) == 3
    picture = sky()
    assert picture.shape == (128, 256, 3)
    assert picture.min() > 0
    assert picture.max() > 5
    assert set(np.unique(diamonds())) == {0, 255}


def test_the_obj_names_its_unit_and_all_corners_exist():
    lines = skirt_obj().splitlines()
    assert "centimetres" in lines[0]
    points = sum(line.startswith("v ") for line in lines)
    places = sum(line.startswith("vt ") for line in lines)
    used = [w.split("/") for line in lines if line.startswith("f ") for w in line.split()[1:]]
    assert {int(a) for a, _ in used} == set(range(1, points + 1))
    assert max(int(b) for _, b in used) <= places


def test_nothing_is_replaced_unasked(folder, tmp_path):
    (tmp_path / "rose.png").write_text("mine")
    with pytest.raises(FabricError, match=r"rose\.png exists"):
        write_samples(tmp_path, clobber=False)
    assert [p.name for p in tmp_path.iterdir()] == ["rose.png"]


def test_a_folder_that_cannot_be_made_is_refused(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["samples", str(tmp_path / "file" / "below")]) == 2
    assert "cannot be made" in capsys.readouterr().err
