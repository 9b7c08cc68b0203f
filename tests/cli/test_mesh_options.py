"""Mesh files on the command line: units, sizes of a dry run, and the exit status."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fabricusd.cli.main import main

CASES = Path(__file__).resolve().parents[1] / "cases"
SMALL = ["--width", "16", "--height", "16", "--spp", "1"]

FILES = {
    # file: (status of render, words on stderr)
    "obj_centimetres/panel_cm.obj": (0, "is 60 m wide and 80 m high"),
    "obj_concave_polygon/ell.obj": (0, "is 0.3 m wide and 0.2 m high"),
    "obj_face_without_vt/mixed.obj": (0, "has no UVs on 2 of 4 triangles; they are rendered grey"),
    "obj_face_without_vt/outofrange.obj": (2, "outofrange.obj:12 has the corner '9/9'"),
    "hostile/obj_novert.obj": (0, "is 1 m wide and 1 m high"),
    "hostile/obj_uv1.obj": (0, "is 1 m wide and 1 m high"),
    "hostile/obj_vertexdim.obj": (2, "obj_vertexdim.obj:5 has 2 numbers"),
    "hostile/glb_index.glb": (2, "indices name vertex 1310725; POSITION has 42"),
    "glb_required_extension/draco.glb": (2, "draco.glb requires the extension KHR_draco_mesh_co"),
    "glb_required_extension/meshopt.glb": (2, "requires the extension EXT_meshopt_compression"),
    "glb_required_extension/instancing.glb": (2, "the extension EXT_mesh_gpu_instancing"),
    "glb_quantized/uv16.glb": (0, "x.png: 1 samples"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_mesh_file_is_rendered_or_refused_in_one_line(tmp_path, capsys, name):
    status, words = FILES[name]
    out = tmp_path / "x.png"
    command = ["render", str(CASES / name), "--fabric", "linen_plain", "-o", str(out), *SMALL]
    assert main(command) == status
    shown = capsys.readouterr().err
    assert words in shown
    assert all(line.startswith("fabricusd: ") for line in shown.splitlines())
    assert out.exists() == (status == 0)
    if status == 2:
        assert len(shown.splitlines()) == 1


def test_dry_runs_print_size_threads_and_texels(tmp_path, capsys):
    path = str(CASES / "obj_centimetres/panel_cm.obj")
    common = [path, "--fabric", "linen_plain", "--units", "cm", "-n", "-o", str(tmp_path / "x.exr")]
    threads = "0.6 m wide and 0.8 m high; 900 warp and 1200 weft threads of linen_plain across"
    assert main(["render", *common]) == 0
    assert f"panel_cm.obj:Front: {threads}" in capsys.readouterr().err
    assert main(["bake", *common]) == 0
    shown = capsys.readouterr()
    assert "1024 x 1024, 0.853 texels per thread; " + threads in shown.out
    assert "0.85 texels per thread; threads are resolved from 2" in shown.err
    assert list(tmp_path.iterdir()) == []


def test_dry_runs_warn_of_a_size_that_is_not_likely(tmp_path, capsys):
    path = str(CASES / "obj_centimetres/panel_cm.obj")
    for command in ("render", "bake"):
        out = str(tmp_path / "x.exr")
        assert main([command, path, "--fabric", "linen_plain", "-n", "-o", out]) == 0
        assert "if it is in centimetres, add --units cm" in capsys.readouterr().err


def test_units_of_a_glb_are_refused_by_every_command(tmp_path, capsys):
    path = str(CASES / "glb_without_material/panel.glb")
    for command in ("render", "bake"):
        out = str(tmp_path / "x.exr")
        given = [command, path, "--fabric", "linen_plain", "--units", "cm", "-o", out]
        assert main(given) == 2
        assert "--units is for .obj and .ply files" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_picture_that_shows_nothing_has_the_status_of_a_finding(tmp_path, capsys):
    scene = tmp_path / "x.usda"
    text = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Mesh "m"
{
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
}
def Camera "c"
{
    float2 clippingRange = (10, 100)
    double3 xformOp:translate = (0, 0, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    scene.write_text(text)
    out = str(tmp_path / "x.png")
    assert main(["render", str(scene), "-o", out, *SMALL]) == 1
    assert "near clipping plane, at 10 m, cuts everything away" in capsys.readouterr().err
    scene.write_text(text.replace("(10, 100)", "(0.1, 100)"))
    assert main(["render", str(scene), "-o", out, *SMALL]) == 0
    scene.write_text("#usda 1.0\n")
    assert main(["render", str(scene), "-o", out, *SMALL]) == 1
    assert main(["render", str(scene), "-o", out, "-n"]) == 1


def test_two_primitives_keep_their_names(tmp_path, capsys):
    path = str(CASES / "glb_random_names/two_prims.glb")
    for _ in range(2):
        given = ["bake", path, "--fabric", "linen_plain", "--mesh", "nosuch", "-o", str(tmp_path)]
        assert main(given) == 2
        assert capsys.readouterr().err == (
            "fabricusd: nosuch is not a mesh of the scene; it must be one of "
            "two_prims.glb:Shirt_a, two_prims.glb:Shirt_b\n"
        )


@pytest.mark.parametrize(
    "name",
    [
        "obj_interleaved_negative/two_panels.obj", "obj_concave_polygon/ell.obj",
        "glb_without_material/panel.glb",
        pytest.param("obj_objects_sharing_material/three.obj", marks=pytest.mark.exhaustive),
    ],
)  # fmt: skip
def test_what_lies_apart_in_the_file_lies_apart_in_the_bake(tmp_path, name):
    given = ["--fabric", "linen_plain", "--resolution", "64", "--maps", "normal", "-q"]
    assert main(["bake", str(CASES / name), *given, "-o", str(tmp_path / "b")]) == 0


def test_pieces_of_one_shape_are_baked_each_on_its_own(tmp_path):
    source, given = CASES / "obj_objects_sharing_material/three.obj", ["--fabric", "linen_plain"]
    given += ["--resolution", "64", "--maps", "normal", "-q", "-o"]
    assert main(["bake", str(source), *given, str(tmp_path / "all")]) == 0
    said = json.loads((tmp_path / "all" / "manifest.json").read_text())
    assert sorted(said["garments"]) == ["Back", "Front", "Sleeve"]
    assert (
        main(["bake", str(source), *given, str(tmp_path / "one"), "--mesh", "three.obj:Back"]) == 0
    )
    said = json.loads((tmp_path / "one" / "manifest.json").read_text())
    assert [one["prims"] for one in said["garments"].values()] == [["three.obj:Back"]]
