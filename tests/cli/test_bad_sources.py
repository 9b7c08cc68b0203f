"""Every kind of source, broken in every way: one line, status 2, and the file there was is kept."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest

from fabricusd.cli.main import main
from fabricusd.fabric import Fabric
from fabricusd.images.files import write_png
from fabricusd.schema import save
from tests.wif_samples import SMALL

GOOD = """#usda 1.0
def WovenFabric "Cloth"
{
    rel fabric:threads = </Cloth/Warp>
    double fabric:warp:density = 20
    int[] fabric:warp:threads = [0]
    string[] fabric:weave:rows = ["10", "01"]
    uniform token fabric:model = "thesis"
    def WovenThread "Warp"
    {
        double thread:ior = 1.5
    }
}
"""

# What is replaced in a good source, by what, and what the one line must hold.
LAYER = {
    "truncated": ('"Warp"\n    {', '"Warp"\n', r"d\.usda:9.* Expected }"),
    "cut in a string": ('"10", "01"]', '"10', r"d\.usda cannot be parsed as USD"),
    "of a wrong type": ("double fabric:warp:density", "float fabric:warp:density",
                        "type float.*must be double"),
    "a value of a wrong type": ("= 20", '= "20"', r"d\.usda:5.* no value of its type: '\"20\"'"),
    "an index out of range": ("= [0]", "= [7]", r"/Cloth fabric:warp:threads .*7; .*from 0 to 0"),
    "a negative density": ("= 20", "= -20", "density is -20; it must be above 0 threads/cm"),
    "a token not allowed": ('"thesis"', '"velours"', "'velours'; it must be one of thesis"),
    "a circle": ("</Cloth/Warp>", "</Cloth.fabric:threads>", "leads in a circle.*must"),
    "not a number": ("ior = 1.5", "ior = nan", "thread:ior is nan; it must be at least 1"),
    "an empty grid": ('["10", "01"]', "[]", "rows is empty; it must have"),
    "rows of two lengths": ('"01"]', '"0"]', r"rows \[1\] has 1 characters; it must have 2"),
    "no thread": ("</Cloth/Warp>", "</Cloth/Weft>", "does not exist; it must be a WovenThread"),
    "values in time alone": ("density = 20", "density.timeSamples = { 1: 20 }", "none at rest"),
}  # fmt: skip

WIF = {
    "truncated": (SMALL[SMALL.index("[TREADLING]") :], "", r"\[TREADLING\] is missing"),
    "of a wrong type": ("[WARP]\nThreads=2", "[WARP]\nThreads=two", "'two'; it must be a whole"),
    "an index out of range": ("[THREADING]\n1=1", "[THREADING]\n1=3", "names 3; it must be from 0"),
    "a negative spacing": ("Spacing=0.05", "Spacing=-1", "'-1'; it must be 0, or a number"),
    "a unit not allowed": ("Units=Inches", "Units=Ells", "'ells'; it must be Decipoints"),
    "not a number": ("Spacing=0.05", "Spacing=nan", r"\[WARP\] Spacing is 'nan'; it must"),
    "an empty cloth": ("[WARP]\nThreads=2", "[WARP]\nThreads=0", "'0'; it must be a whole number"),
    "a size that disagrees": ("Shafts=2", "Shafts=1", "2 names 2; it must be from 0 to 1"),
    "a colour of no table": ("Color=2", "Color=9", r"\[WEFT\] Color is '9'; it must be a colour"),
    "a billion threads": ("[WEFT]\nThreads=2", "[WEFT]\nThreads=1000000000", "from 1 to 16384"),
}

WEAVE = {
    "truncated": ("mod(i + j", "character .*cannot be read; write it as in"),
    "empty": ("", "must be one of plain"),
    "of a wrong type": ("mod(i + j, 2.5) < 1", "'2.5' is not a sum of whole multiples"),
    "without a comparison": ("mod(i + j, 2)", "must be a comparison, as in"),
    "by zero": ("mod(i + j, 0) < 1", "divides by 0; the divisor must be at least 1"),
    "a name not known": ("mod(k, 2) < 1", "'k' is not a sum of whole multiples of i and j"),
    "too large": ("mod(i, 99991) < 1", "repeats after 99991 x 1; it must be at most 4096"),
    "a satin that is none": ("satin 6 step 2", "a satin must have 5, 7 or more"),
    "code": ("__import__('os').getcwd() == 1", "must be mod, shift or scale"),
}


def assert_says(line: str, message: str) -> None:
    assert re.search(message, line), line


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line of a command that is refused."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1, err
    assert err.startswith("fabricusd: ")
    return err


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """An output that exists; afterwards it is as it was, and nothing lies beside it."""
    monkeypatch.chdir(tmp_path)
    Path("out.usda").write_text("precious")
    yield "out.usda"
    assert Path("out.usda").read_text() == "precious"
    assert not [path.name for path in tmp_path.iterdir() if "partial" in path.name]


@pytest.mark.parametrize("fault", LAYER)
def test_a_broken_layer(fault, kept, capsys):
    old, new, message = LAYER[fault]
    assert GOOD.count(old) == 1
    Path("d.usda").write_text(GOOD.replace(old, new))
    told = refused(capsys, "new", "--weave", "plain", "--thread", "d.usda", "-o", kept)
    assert told == refused(capsys, "cat", "d.usda")
    assert_says(told, message)


@pytest.mark.parametrize("fault", WIF)
def test_a_broken_draft(fault, kept, capsys):
    old, new, message = WIF[fault]
    assert old in SMALL
    Path("d.wif").write_text(SMALL.replace(old, new))
    assert_says(refused(capsys, "new", "--wif", "d.wif", "-o", kept), message)


@pytest.mark.parametrize("fault", WEAVE)
def test_a_broken_weave(fault, kept, capsys):
    text, message = WEAVE[fault]
    assert_says(refused(capsys, "new", "--weave", text, "-o", kept), message)


def photograph() -> None:
    write_png("d.png", np.random.default_rng(1).integers(0, 255, (40, 40, 3)).astype(np.uint8))


def one_color() -> None:
    write_png("d.png", np.full((4, 4, 3), (200, 0, 0), np.uint8))


def cut_short() -> None:
    photograph()
    Path("d.png").write_bytes(Path("d.png").read_bytes()[:900])


IMAGE = {
    "truncated": (cut_short, "cannot be read to its end"),
    "of a wrong type": (lambda: Path("d.png").write_text("hello"), "is not an image"),
    "empty": (lambda: Path("d.png").touch(), "is empty; it must hold something"),
    "no threads": (one_color, "shows no weft thread; it must show"),
    "a photograph": (photograph, "colours; it must have at most 64"),
}


@pytest.mark.parametrize("fault", IMAGE)
def test_a_broken_image(fault, kept, capsys):
    make, message = IMAGE[fault]
    make()
    assert_says(refused(capsys, "new", "--image", "d.png", "-o", kept), message)


NO_FILE = {
    "missing": "no file|No such file|does not exist",
    "directory": "is a directory; it must be a file",
    "empty": "is empty; it must hold",
    "pipe": "is a pipe or a device; it must be a file",
}
SOURCES = {"layer": "--thread", "draft": "--wif", "image": "--image"}
SUFFIX = {"layer": ".usda", "draft": ".wif", "image": ".png"}


@pytest.mark.parametrize("kind", SOURCES)
@pytest.mark.parametrize("fault", NO_FILE)
def test_a_source_that_is_no_file(kind, fault, kept, capsys):
    path = Path(f"d{SUFFIX[kind]}")
    if fault == "directory":
        path.mkdir()
    elif fault == "empty":
        path.touch()
    elif fault == "pipe":
        if not hasattr(os, "mkfifo"):
            pytest.skip("no pipes in folders here")
        os.mkfifo(path)
    source = [SOURCES[kind], str(path)]
    weave = ["--weave", "plain"] if kind == "layer" else []
    assert_says(refused(capsys, "new", *weave, *source, "-o", kept), f"{path} .*({NO_FILE[fault]})")


@pytest.mark.parametrize("length", [0.1, 0.5, 0.9])
def test_a_layer_in_binary_that_is_cut(length, kept, capsys):
    save(Fabric(), "whole.usdc")
    data = Path("whole.usdc").read_bytes()
    Path("d.usdc").write_bytes(data[: int(len(data) * length)])
    told = refused(capsys, "new", "--weave", "plain", "--thread", "d.usdc", "-o", kept)
    assert_says(told, r"d\.usdc cannot be parsed as USD")


@pytest.mark.parametrize("arguments", [("cat", "a.dtx"), ("new", "--wif", "a.dtx", "-o", "")])
def test_a_draft_of_another_program(arguments, kept, capsys):
    Path("a.dtx").write_text("@@StartDTX\n@@Info\n%%shafts 4\n")
    said = refused(capsys, *(a or kept for a in arguments))
    assert said == "fabricusd: a.dtx is a .dtx draft (Fiberworks); export it as WIF\n"


def test_lines_that_no_one_uses_are_told_and_the_draft_is_read(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("d.wif").write_text(SMALL.replace("[TIEUP]\n", "[TIEUP]\n9=1\n"))
    assert main(("cat", "d.wif")) == 0
    assert "d.wif: [TIEUP] has 1 line(s) for treadles outside 1 to 2" in capsys.readouterr().err
