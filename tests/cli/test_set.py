"""`set`: as a person types it."""

from __future__ import annotations

from fabricusd.schema import load
from tests.cli.commands import run


def test_set_changes_the_layer_and_says_what(capsys, tmp_path):
    layer = tmp_path / "d.usda"
    run(capsys, "new", "--weave", "twill 3/1", "--warp-color", "#123", "--weft-color", "#eee",
        "-o", str(layer))  # fmt: skip
    status, out, err = run(capsys, "set", str(layer), "roughness=0.6", "warp.ior=1.6")
    assert (status, out) == (0, "")
    assert f"fabricusd: {layer}: roughness = 0.6, on 2 prims" in err
    assert load(layer).thread_list[0].ior == 1.6
    status, _, _ = run(capsys, "set", "-n", str(layer), "ior=1.7")
    assert status == 0
    assert load(layer).thread_list[0].ior == 1.6


def test_a_slip_is_one_line_and_status_2(capsys, tmp_path):
    layer = tmp_path / "d.usda"
    run(capsys, "new", "--weave", "plain", "-o", str(layer))
    before = layer.read_bytes()
    status, _, err = run(capsys, "set", str(layer), "roughnes=0.6")
    assert status == 2
    assert "(did you mean 'roughness'?)" in err
    assert len(err.splitlines()) == 1
    assert layer.read_bytes() == before
