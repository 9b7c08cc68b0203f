"""Sources that cannot be read: one line, with the place, and nothing else."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from fabricusd import FabricError
from fabricusd.schema import check, load, save
from fabricusd.schema.edit.edit import Change, set_values
from fabricusd.schema.source import split_source, variants_of

TWO = """#usda 1.0
def WovenFabric "A"
{
    def WovenThread "T"
    {
    }
}
def WovenFabric "B" (references = </A>)
{
}
def Xform "C"
{
}
"""


def write(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return str(path)


CASES = {
    "a preset that does not exist": (
        None, "linnen", "is neither a file nor a preset; presets .*linen_plain"),
    "a knit": (
        None, "cotton jersey", "is knitted, not woven; .* near is 'cotton_poplin'$"),
    "a part of a preset's name": (None, "tweed", "did you mean 'herringbone_tweed'"),
    "a missing file": (None, "nowhere.usda", "nowhere.usda does not exist"),
    "an empty file": (("e.usda", b""), "{}", "is empty"),
    "a text that is no USD": (("t.usda", "hello"), "{}", "cannot be parsed as USD"),
    "a truncated USD text": (("t.usda", '#usda 1.0\ndef WovenFabric "A" {'), "{}", r"t.usda:2"),
    "a truncated binary": (("t.usdc", b"PXR-USDC\0\0"), "{}", "cannot be parsed as USD"),
    "a text that is not UTF-8": (
        ("t.usda", b'#usda 1.0\ndef WovenFabric "A"\n{\n\xff\n}\n'), "{}", "byte 0xff in line 4"),
    "documentation that is not UTF-8": (
        ("t.usda", b'#usda 1.0\ndef WovenFabric "A" (doc = "\xe9")\n{\ndef WovenThread "T" {\n}}'),
        "{}", "byte 0xe9 in line 2; .* UTF-8"),
    "a text that is a parser's riddle": (
        ("t.usda", '#usda 1.0\ndef WovenFabric "A"\n{\ndouble a.spline = { 1: 5; 2: 8}\n}\n'), "{}",
        "t.usda:4.* does not parse at"),
    "another kind of file": (("t.txt", "hello"), "{}", "is not USD; it must be .usda"),
    "a stage without a fabric": (("x.usda", '#usda 1.0\ndef Xform "X"\n{\n}\n'), "{}",
                                 "has no WovenFabric prim"),
    "two fabrics and none named": (("two.usda", TWO), "{}", "holds 2 fabrics; name one of .*:/A"),
    "a prim path of nothing": (("two.usda", TWO), "{}:/Nowhere", ":/Nowhere does not exist"),
    "a prim of another type": (("two.usda", TWO), "{}:/C", ":/C is Xform; .* be a WovenFabric"),
    "no prim path at all": (("two.usda", TWO), "{}:/a b", "is not a prim path"),
    "a reference to nowhere": (
        ("r.usda", '#usda 1.0\ndef WovenFabric "A" (references = @gone.usda@)\n{\n}\n'), "{}",
        "does not compose: .*gone.usda"),
    "a layer that includes itself": (
        ("s.usda", '#usda 1.0\n(\nsubLayers = [@s.usda@]\n)\ndef WovenFabric "A"\n{\n}\n'), "{}",
        "does not compose"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_broken_source_is_one_clear_line(case, tmp_path, capfd):
    file, source, message = CASES[case]
    if file:
        source = source.format(write(tmp_path, *file))
    with pytest.raises(FabricError, match=message) as caught:
        load(source)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 700
    assert capfd.readouterr().err == ""


def test_a_drive_is_no_file():
    assert split_source("C:/cloth.usda") == (Path("C:/cloth.usda"), "")
    assert split_source("C:/cloth.usda:/A/B") == (Path("C:/cloth.usda"), "/A/B")


VARIANTS = """#usda 1.0
(
    defaultPrim = "A"
)
def WovenFabric "A" (
    references = @linen.usda@
    variants = { string dye = "blue" }
    prepend variantSets = ["dye", "nap"]
)
{
    variantSet "dye" = {
        "blue" {
        }
        "red" {
            over "Linen"
            {
                uniform color3d thread:albedo = (0.5, 0.1, 0.1)
            }
        }
    }
    variantSet "nap" = {
        "flat" {
        }
        "rough" {
            over "Linen"
            {
                uniform double thread:gammaSurface = 30
            }
        }
    }
}
"""


@pytest.fixture
def dyed(tmp_path):
    save(load("linen_plain"), tmp_path / "linen.usda")
    return write(tmp_path, "dyed.usda", VARIANTS)


def test_a_source_chooses_variants(dyed):
    before = Path(dyed).read_bytes()
    plain, red = load(dyed), load(f"{dyed}:/A{{dye=red}}{{nap=rough}}")
    assert red.thread_list[0].albedo == (0.5, 0.1, 0.1)
    assert red.thread_list[0].gamma_surface == pytest.approx(np.radians(30))
    assert load(f"{dyed}{{dye=red}}").thread_list[0].albedo == (0.5, 0.1, 0.1)
    assert load(dyed) == plain
    assert plain.thread_list[0].albedo != (0.5, 0.1, 0.1)
    assert Path(dyed).read_bytes() == before


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ("{dye=green}", "has no variant 'green'; it must be one of blue, red"),
        ("{colour=red}", "has no variant set 'colour'; the fabric's sets are: dye, nap"),
        ("{dye}", "does not exist"),
    ],
)
def test_a_variant_that_is_not_there_is_named(dyed, choice, message):
    with pytest.raises(FabricError, match=message):
        load(f"{dyed}{choice}")


def test_a_file_whose_name_ends_like_a_choice_is_read(dyed, tmp_path):
    path = tmp_path / "cloth{dye=red}"
    Path(dyed).with_name("linen.usda").rename(path)
    assert variants_of(path) == ()
    assert split_source(path) == (path, "")


def test_values_are_set_in_a_variant_by_its_option_alone(dyed):
    with pytest.raises(FabricError, match="name it with --variant"):
        set_values(f"{dyed}{{dye=red}}", [Change(name="thread:ior", text="1.4")])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in folders here")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.usda")
    with pytest.raises(FabricError, match="is a pipe or a device"):
        load(tmp_path / "a.usda")


@pytest.mark.parametrize("reader", [load, check])
def test_a_directory_is_refused(reader, tmp_path):
    with pytest.raises(FabricError, match="is a directory"):
        reader(tmp_path)


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may read everything")
def test_a_file_without_permission_is_refused(tmp_path):
    path = write(tmp_path, "a.usda", TWO)
    os.chmod(path, 0)
    with pytest.raises(FabricError, match="cannot be read: Permission denied"):
        load(path)


def test_a_prim_path_chooses_the_fabric(tmp_path):
    assert load(write(tmp_path, "two.usda", TWO) + ":/B").name == "B"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("cloth.txt", "has another suffix"),
        ("nowhere/cloth.usda", "is not a directory"),
        ("taken.usda", "is a directory"),
    ],
)
def test_an_output_that_cannot_be_written_is_refused_and_leaves_nothing(name, message, tmp_path):
    (tmp_path / "taken.usda").mkdir()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(FabricError, match=message):
        save(load("velvet"), tmp_path / name)
    assert sorted(tmp_path.rglob("*")) == before


def test_no_clobber_keeps_what_is_there(tmp_path):
    target = tmp_path / "cloth.usda"
    save(load("velvet"), target)
    kept = target.read_bytes()
    with pytest.raises(FabricError, match="exists"):
        save(load("linen_plain"), target, clobber=False)
    assert target.read_bytes() == kept


def test_a_write_that_fails_half_way_leaves_the_old_file_whole(tmp_path, monkeypatch):
    target = tmp_path / "cloth.usda"
    save(load("velvet"), target)
    kept = target.read_bytes()

    def full(self, _target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(FabricError, match="No space left on device"):
        save(load("linen_plain"), target)
    assert target.read_bytes() == kept
    assert [p.name for p in tmp_path.iterdir()] == ["cloth.usda"]
