"""`render --view`: the picture's view, and its name in the files."""

from __future__ import annotations

import OpenImageIO as oiio
import pytest

from tests.cli.commands import run

OBJ = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"


def metadata(path):
    return {each.name: each.value for each in oiio.ImageBuf(str(path)).spec().extra_attribs}


@pytest.mark.parametrize("view", ["neutral", "aces", "ocio ocio://default:Un-tone-mapped"])
def test_the_name_of_the_view_is_in_both_files(capsys, tmp_path, view):
    (tmp_path / "x.obj").write_text(OBJ)
    out = tmp_path / "x.exr"
    status, _, err = run(
        capsys, "render", str(tmp_path / "x.obj"), "--fabric", "linen_plain", "--units", "m",
        "--width", "8", "--height", "8", "--spp", "4", "--view", view, "-o", str(out),
    )  # fmt: skip
    assert status == 0, err
    assert metadata(out)["fabricusd:view"] == view
    assert metadata(out.with_suffix(".png"))["fabricusd:view"] == view


def test_a_view_that_is_none_is_refused_before_the_scene_is_read(capsys, tmp_path):
    status, _, err = run(
        capsys, "render", "nowhere.usda", "--view", "filmic", "-o", str(tmp_path / "x.png")
    )
    assert status == 2
    assert err.startswith("fabricusd: --view is 'filmic'; it must be neutral, srgb, aces")
