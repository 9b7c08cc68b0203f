"""The commands as a person types them: what they print, where, and their exit status."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fabricusd.cli.main import COMMANDS, main
from fabricusd.fabric import Fabric
from fabricusd.schema import load, preset_names

ROOT = str(Path(__file__).resolve().parents[2])


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    try:
        status = main(arguments)
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    return status, out, err


def test_help_names_every_command_and_imports_nothing_heavy():
    script = (
        "import sys; from fabricusd.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('pxr', 'numpy', 'numba', 'scipy', 'OpenImageIO') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True).stdout
    assert all(command in out for command in COMMANDS)
    assert out.endswith("[]\n")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(command, capsys):
    status, out, _ = run(capsys, command, "--help")
    assert status == 0
    assert "example:" in out


@pytest.mark.parametrize("name", preset_names())
def test_cat_describes_a_preset_and_draws_it(name, capsys):
    status, out, err = run(capsys, "cat", name)
    assert status == 0
    assert err == ""
    assert out.startswith(f"{name}: ")
    assert "ends/cm" in out


def test_cat_json_is_the_fabric(capsys):
    status, out, _ = run(capsys, "cat", "silk_shot", "--json")
    told = json.loads(out)
    assert status == 0
    assert told["threads"]["Green"]["gamma_surface"] == pytest.approx(4)
    assert told["weave"]["rows"] == ["10", "01"]
    assert told["warp"]["area"] + told["weft"]["area"] + told["gap"] == pytest.approx(1)


def test_cat_flatten_is_usd_that_reads_back(capsys, tmp_path):
    _, out, _ = run(capsys, "cat", "polyester_satin_charmeuse", "--flatten")
    (tmp_path / "flat.usda").write_text(out)
    assert load(tmp_path / "flat.usda") == load("polyester_satin_charmeuse")


def test_new_without_output_prints_usd_that_reads_back(capsys, tmp_path):
    status, out, err = run(capsys, "new", "--preset", "velvet")
    (tmp_path / "velvet.usda").write_text(out)
    assert (status, err) == (0, "")
    assert load(tmp_path / "velvet.usda") == load("velvet")


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
def test_new_writes_what_it_was_told(suffix, capsys, tmp_path):
    path = tmp_path / f"tartan{suffix}"
    status, out, _ = run(
        capsys, "new", "--weave", "twill 2/2", "--warp-color", "4*#111111", "2*#ff0000",
        "--weft-color", "#ffffff", "--ends-per-cm", "24", "--picks-per-cm", "18",
        "--thread", "linen_plain", "--thickness", "0.3", "-o", str(path), "-q",
    )  # fmt: skip
    fabric = load(path)
    assert (status, out) == (0, "")
    assert fabric.name == "tartan"
    assert len(fabric.threads) == 3
    assert fabric.warp.sequence == (0, 0, 0, 0, 1, 1)
    assert (fabric.warp.density, fabric.weft.density) == (2400, 1800)
    assert {t.thickness for t in fabric.thread_list} == {0.3e-3}
    assert {t.ior for t in fabric.thread_list} == {1.46}


def test_a_fabric_goes_out_as_wif_and_comes_back(capsys, tmp_path):
    wif, usd = tmp_path / "satin.wif", tmp_path / "satin.usda"
    assert run(capsys, "new", "--weave", "satin 8 step 3", "-o", str(wif))[0] == 0
    assert run(capsys, "new", "--wif", str(wif), "-o", str(usd), "-q")[0] == 0
    _, text, _ = run(capsys, "cat", str(usd), "--wif")
    assert "[WEAVING]" in text
    (tmp_path / "again.wif").write_text(text)
    assert run(capsys, "cat", str(tmp_path / "again.wif"), "-q")[0] == 0


def test_an_unknown_option_points_at_the_help_of_its_command(capsys):
    _, _, err = run(capsys, "cat", "velvet", "--xyzzyxyzzy\non")
    assert err == (
        "fabricusd cat: unrecognized arguments: --xyzzyxyzzy on; see 'fabricusd cat --help'\n"
    )


def test_dry_run_writes_nothing(capsys, tmp_path):
    path = tmp_path / "a.usda"
    status, out, err = run(capsys, "new", "--preset", "velvet", "-o", str(path), "-n")
    assert (status, out) == (0, "")
    assert str(path) in err
    assert not path.exists()


def test_no_clobber_refuses_and_keeps(capsys, tmp_path):
    path = tmp_path / "a.usda"
    path.write_text("precious")
    status, _, err = run(capsys, "new", "--preset", "velvet", "-o", str(path), "--no-clobber")
    assert status == 2
    assert "exists" in err
    assert path.read_text() == "precious"


BAD = {
    "no command": [],
    "an unknown command": ["weave"],
    "an unknown option": ["cat", "velvet", "--jsno"],
    "no source": ["new", "-o", "a.usda"],
    "two sources": ["new", "--preset", "velvet", "--weave", "plain"],
    "an unknown preset": ["new", "--preset", "velours"],
    "a preset that would be a knit": ["new", "--preset", "jersey"],
    "a preset without a name": ["new", "--preset", ""],
    "a preset with an option for drafts": ["new", "--preset", "velvet", "--thickness", "0"],
    "an unknown weave": ["new", "--weave", "twil 2/1"],
    "a satin that is none": ["new", "--weave", "satin 6 step 2"],
    "an expression that is none": ["new", "--weave", "mod(i + j, 0) < 1"],
    "an expression with a call": ["new", "--weave", "__import__('os') < 1"],
    "a colour that is none": ["new", "--weave", "plain", "--warp-color", "burnt"],
    "a count that is none": ["new", "--weave", "plain", "--warp-color", "0*#fff"],
    "an unknown thread": ["new", "--weave", "plain", "--thread", "velvet:Pile9"],
    "a negative density": ["new", "--weave", "plain", "--ends-per-cm", "-3"],
    "a density that is no number": ["new", "--weave", "plain", "--ends-per-cm", "many"],
    "a NaN density": ["new", "--weave", "plain", "--picks-per-cm", "nan"],
    "a density beyond numbers": ["new", "--weave", "plain", "--ends-per-cm", "1e308"],
    "an endless thickness": ["new", "--weave", "plain", "--thickness", "inf"],
    "a negative thickness": ["new", "--weave", "plain", "--thickness", "-1"],
    "an output of another kind": ["new", "--preset", "velvet", "-o", "a.fbx"],
    "an output in no folder": ["new", "--preset", "velvet", "-o", "nowhere/a.usda"],
    "an output without a name": ["new", "--weave", "plain", "-o", ""],
    "an output whose name is too long": ["new", "--weave", "plain", "-o", "a" * 300 + ".usda"],
    "an output whose name is no text": ["new", "--weave", "plain", "-o", "\udcff.usda"],
    "a missing draft": ["new", "--wif", "nowhere.wif"],
    "a draft without a name": ["new", "--wif", ""],
    "a missing image": ["new", "--image", "nowhere.png"],
    "an image without a name": ["new", "--image", ""],
    "invert without an image": ["new", "--weave", "plain", "--invert"],
    "cat of nothing": ["cat", "nowhere.usda"],
    "cat of a prim that is not there": ["cat", "velvet", "/Nowhere"],
    "flatten of a missing file": ["cat", "nowhere.usda", "--flatten"],
    "cat of a name with a line end": ["cat", "no\nwhere.usda"],
    "cat of a name that is too long": ["cat", "a" * 300 + ".usda"],
    "check of nothing": ["check"],
    "check of a missing file": ["check", "nowhere.usda"],
    "check of a folder": ["check", "."],
    "check of a prim that is not there": ["check", "velvet:/Nowhere"],
    "flatten of a prim that is not there": ["cat", "velvet:/Nowhere", "--flatten"],
    "a package of another kind": ["material", ".", "--usdz", "a.zip"],
    "a package in no folder": ["material", ".", "--usdz", "nowhere/a.usdz"],
    "a swatch in no folder": ["material", ".", "--u3m", "nowhere/cad"],
    "a swatch where a file is": ["material", ".", "--u3m", "taken"],
    "a tile in no folder": ["material", ".", "--swatch", "nowhere/tiles"],
    "a tile where a file is": ["material", ".", "--swatch", "taken"],
    "a garment as glTF of another kind": ["material", ".", "--glb", "a.gltf"],
    "a garment as glTF in no folder": ["material", ".", "--glb", "nowhere/a.glb"],
    "a page in no folder": ["chart", "-o", "out", "--page", "nowhere/a.md"],
    "a table of choices in no folder": ["chart", "--choice", "nowhere/a.json"],
    "a stability page in no folder": ["chart", "-o", "out", "--stability", "nowhere/a.md"],
    "charts where a file is": ["chart", "-o", "taken", "--panel", "zoom"],
    "charts of an unknown panel": ["chart", "-o", "out", "--panel", "nothing"],
    "a demo where a file is": ["demo", "-o", "taken"],
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_status_2_and_writes_nothing(case, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("")
    before = sorted(tmp_path.iterdir())
    status, _, err = run(capsys, *BAD[case])
    lines = err.splitlines()
    assert status == 2
    assert len(lines) == 1, err
    assert lines[0].startswith("fabricusd")
    assert lines[0].isprintable()
    assert sorted(tmp_path.iterdir()) == before


WRITES = {
    "a full disk": (["cat", "velvet"], "/dev/full", "", 2),
    "a full disk, for a layer": (["new", "--preset", "velvet"], "/dev/full", "", 2),
    "an output of few characters": (["cat", "velvet"], "out", "ascii", 0),
    "an output of Windows": (["cat", "velvet"], "out", "cp1252", 0),
}


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has /dev/full")
@pytest.mark.parametrize("case", WRITES)
def test_no_standard_output_makes_a_traceback(case, tmp_path, monkeypatch):
    arguments, out, encoding, wanted = WRITES[case]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONIOENCODING", encoding)
    with open(out, "w") as stdout:
        done = subprocess.run(
            [sys.executable, "-m", "fabricusd", *arguments],
            stdout=stdout, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": ROOT}
        )  # fmt: skip
    assert done.returncode == wanted
    assert len(done.stderr.splitlines()) == (1 if wanted else 0), done.stderr


def test_a_layer_is_printed_as_utf_8_whatever_the_output_is(tmp_path):
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONPATH": ROOT}
    done = subprocess.run(
        [sys.executable, "-m", "fabricusd", "new", "--weave", "plain", "--name", "Größe", "-q"],
        stdout=subprocess.PIPE, env=environment, check=True,
    )  # fmt: skip
    (tmp_path / "x.usda").write_bytes(done.stdout)
    assert load(tmp_path / "x.usda").name == "Größe"


def test_check_of_a_prim_looks_at_nothing_above_it(capsys, tmp_path):
    (tmp_path / "two.usda").write_text(
        '#usda 1.0\ndef WovenFabric "A"\n{\ndef WovenThread "T"\n{\n}\n}\n'
        'def WovenFabric "B"\n{\n}\n'
    )
    assert run(capsys, "check", f"{tmp_path}/two.usda:/A")[0] == 0
    assert run(capsys, "check", f"{tmp_path}/two.usda:/B")[0] == 1


def test_a_dash_is_standard_output(capsys):
    assert run(capsys, "new", "--preset", "velvet", "-o", "-") == run(
        capsys, "new", "--preset", "velvet"
    )


def test_a_prim_is_named_with_its_slash_or_without(capsys):
    assert run(capsys, "cat", "velvet", "velvet") == run(capsys, "cat", "velvet", "/velvet")


def test_check_tells_findings_by_status(capsys, tmp_path):
    path = tmp_path / "a.usda"
    path.write_text('#usda 1.0\ndef WovenFabric "A"\n{\ndouble fabric:warp:densty = 2\n'
                    'def WovenThread "T"\n{\n}\n}\n')  # fmt: skip
    assert run(capsys, "check", "velvet")[0] == 0
    assert run(capsys, "check", str(path))[0] == 0
    assert run(capsys, "check", str(path), "--strict")[0] == 1
    path.write_text(path.read_text().replace("densty", "density").replace("= 2", "= -2"))
    status, out, _ = run(capsys, "check", str(path), "velvet")
    assert status == 1
    assert "must be above 0 threads/cm" in out
    status, out, _ = run(capsys, "check", str(path), "--json")
    assert json.loads(out)[0]["property"] == "fabric:warp:density"
    assert run(capsys, "check", str(path), "nowhere.usda")[0] == 2


def test_list_rules_prints_each_with_its_meaning(capsys):
    from fabricusd.schema.rules.rules import RULES

    _, out, _ = run(capsys, "check", "--list-rules")
    assert len(out.splitlines()) == len(RULES)


def test_plugin_path_is_a_folder_with_a_plug_info(capsys):
    _, out, _ = run(capsys, "plugin-path")
    assert (Path(out.strip()) / "plugInfo.json").is_file()
    _, both, _ = run(capsys, "plugin-path", "--validators")
    assert both.startswith(out.strip() + os.pathsep)
    assert all((Path(p) / "plugInfo.json").is_file() for p in both.strip().split(os.pathsep))


def test_demo_authors_checks_and_prints_every_preset(capsys, tmp_path):
    status, out, err = run(capsys, "demo", "-v", "-o", str(tmp_path / "demo"))
    assert status == 0, err
    for name in preset_names():
        assert load(tmp_path / "demo" / f"{name}.usda") == load(name)
        assert f"{name}: " in out


def test_import_loads_neither_usd_nor_a_compiler():
    script = (
        "import sys, fabricusd; fabricusd.Fabric; fabricusd.FabricError\n"
        "print([m for m in ('pxr', 'numba', 'embreex') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True).stdout
    assert out == "[]\n"
    assert Fabric().name == "Fabric"
