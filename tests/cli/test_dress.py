"""`dress`: as a person types it."""

from __future__ import annotations

from tests.cli.commands import run

OBJ = "v 0 0 0\nv 60 0 0\nv 60 80 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n"


def test_dress_writes_a_scene_and_says_how_to_see_it(capsys, tmp_path):
    (tmp_path / "shirt.obj").write_text(OBJ)
    out = tmp_path / "shirt.usda"
    status, stdout, err = run(
        capsys, "dress", str(tmp_path / "shirt.obj"), "--units", "cm", "--fabric", "linen_plain",
        "--grain", "45", "--scale", "600", "-o", str(out),
    )  # fmt: skip
    assert (status, stdout) == (0, "")
    assert "0.6 m wide and 0.8 m high" in err
    assert f"fabricusd render {out} -o {out.with_suffix('.exr')}" in err
    assert "fabric:binding:rotation = 45" in out.read_text()
    status, _, err = run(
        capsys, "dress", str(tmp_path / "shirt.obj"), "--fabric", "linen_plain", "-o", str(out),
        "--no-clobber",
    )  # fmt: skip
    assert status == 2
    assert "exists" in err
