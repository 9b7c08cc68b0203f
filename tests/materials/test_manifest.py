"""A bake folder that somebody else made: nothing is read or written outside of it."""

from __future__ import annotations

import copy
import json
import os
import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Sdf, Usd

from fabricusd.bake.error.relight import BakedSet
from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from fabricusd.images.files import write_mip_exr
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings
from tests.fuzz import examples
from tests.materials.scenes import bake_shirt

CASES = Path(__file__).resolve().parents[1] / "cases" / "hostile"
PLAIN = Settings(fitted=False)


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    return bake_shirt(tmp_path_factory.mktemp("shirt"))[1]


@pytest.fixture(scope="module")
def tiled(tmp_path_factory):
    return bake_shirt(tmp_path_factory.mktemp("tiled"), udim=True)[1]


@pytest.fixture
def folder(baked, tmp_path):
    """A copy three folders down, with a secret beside it."""
    place = tmp_path / "a" / "b" / "c" / "bake"
    shutil.copytree(baked, place)
    shutil.copy(next(baked.glob("*.base_color.exr")), place.parent / "secret.exr")
    return place


def said_in(folder: Path) -> dict:
    return json.loads((folder / "manifest.json").read_text())


def say(folder: Path, said: object) -> None:
    (folder / "manifest.json").write_text(json.dumps(said))


def everything(root: Path, but: Path) -> dict[Path, bytes]:
    """All files below `root` that are not below `but`."""
    found = [Path(place) / name for place, _, names in os.walk(root) for name in names]
    return {path: path.read_bytes() for path in found if but not in path.parents}


def test_the_hostile_manifest_writes_nothing(folder, tmp_path, capsys):
    shutil.copy(CASES / "manifest_escapes.json", folder / "manifest.json")
    before = everything(tmp_path, tmp_path / "nothing")
    assert main(["material", str(folder), "--no-fit"]) == 2
    error = capsys.readouterr().err
    assert "garments/../../../escaped" in error
    assert error.count("\n") == 1
    assert everything(tmp_path, tmp_path / "nothing") == before


def changed(said: dict, place: str, value: object) -> dict:
    """The manifest with one value replaced, by keys joined with |; `None` to take it away."""
    said = copy.deepcopy(said)
    keys: list = [int(k) if k.isdigit() and len(k) < 3 else k for k in place.split("|")]
    held = said
    for key in keys[:-1]:
        held = held[key]
    if value is None:
        del held[keys[-1]]
    else:
        held[keys[-1]] = value
    return said


ONE, FILE = "garments|Body", "garments|Body|files|base_color|1001"
FAULTS = [
    ("garments", [], "garments is []; it must be an object"),
    ("garments", {}, "at least one garment"),
    ("garments|../../x", {}, "the name of one garment"),
    ("garments|/etc/x", {}, "the name of one garment"),
    ("garments|body", {}, "the name of one garment"),
    ("garments|nul", {}, "the name of one garment"),
    ("garments|a\\b", {}, "the name of one garment"),
    (f"{ONE}|prims", [0] * 10**5, "garments/Body/prims/0 is 0; it must be a string"),
    (f"{ONE}|mesh", [0] * 10**5, "a list of 100000 entries"),
    (ONE, 3, "says garments/Body is 3; it must be an object"),
    (f"{ONE}|mesh", "../secret.usdc", "it must be Body.usdc"),
    (f"{ONE}|mesh", None, "has no 'mesh' in garments/Body"),
    (f"{ONE}|uv_of_the_scene", "yes", "it must be true or false"),
    (f"{ONE}|prims", "/Shirt", "it must be a list"),
    (f"{ONE}|prims", [1], "it must be a string"),
    (f"{ONE}|prims", [], "at least one entry"),
    (f"{ONE}|fingerprint", 1, "it must be a string"),
    (f"{ONE}|error", [], "it must be an object"),
    (f"{ONE}|error|point", "x", "it must be a number"),
    (f"{ONE}|lays", {}, "it must be a list"),
    (f"{ONE}|lays|0|fabric", "../x", "the name of a fabric"),
    (f"{ONE}|lays|0|fabric", "linen_plain:/x", "the name of a fabric"),
    (f"{ONE}|lays|0|threads_per_uv", [[1, 2], [2, 4]], "an invertible matrix"),
    (f"{ONE}|lays|0|threads_per_uv", [[0, 0], [2, 4]], "an invertible matrix"),
    (f"{ONE}|lays|0|threads_per_uv", [[1, 2, 3], [2, 4]], "a list of 2 entries"),
    (f"{ONE}|lays|0|threads_per_uv|0|0", float("nan"), "a number from -1e+30 to 1e+30"),
    (f"{ONE}|lays|0|offset|1", 10**400, "a number from -1e+30 to 1e+30"),
    (f"{ONE}|lays|0|offset", None, "has no 'offset' in garments/Body/lays/0"),
    (FILE, "../secret.exr", "it must be an object"),
    (f"{FILE}|file", "../secret.exr", "it must be one of Body.base_color.exr"),
    (f"{FILE}|file", "/etc/passwd", "it must be one of Body.base_color.exr"),
    (f"{FILE}|file", "Body.normal.exr", "it must be one of Body.base_color.exr"),
    (f"{FILE}|file", ["x"], "it must be a string"),
    (f"{FILE}|encoding", {"transfer": "x"}, "a valid encoding"),
    (f"{ONE}|files|base_color", {}, "the same tiles as the other maps have"),
    (f"{ONE}|files|base_color|../../1001", {}, "it must be for tile 1001"),
    (f"{ONE}|files|unknown", {}, "for a map listed in 'maps'"),
    ("maps|base_color|channels", "RGB", "it must be a list"),
    ("maps|base_color|channels", ["Y"], "the list R, G, B"),
    ("maps|../x", {}, "an entry for one of"),
    ("settings|udim", 1, "settings/udim is 1; it must be true or false"),
    ("settings", None, "has no 'settings' in its root"),
    ("resolution", [64], "a power of two"),
    ("resolution", 64.0, "a power of two"),
    ("scene|file", {}, "it must be a string"),
]  # fmt: skip


@pytest.mark.parametrize(("place", "value", "words"), FAULTS)
def test_a_field_that_no_baker_writes_is_refused_with_its_place(
    folder, tmp_path, place, value, words
):
    say(folder, changed(said_in(folder), place, value))
    before = everything(tmp_path, tmp_path / "nothing")
    for read in (read_bake_folder, BakedSet.load, lambda f: write_materials(f, None, PLAIN)):
        with pytest.raises(FabricError) as error:
            read(folder)
        assert words in str(error.value)
        assert "\n" not in str(error.value)
        assert str(folder) in str(error.value)
    assert everything(tmp_path, tmp_path / "nothing") == before


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff",
        b"[",
        b"[" * 10**6,
        b'{"garments": ' * 10**5,
        b"1" * 10**5,
        b"NaN",
        b"0" * (9 << 20),
    ],
)
def test_a_file_that_is_no_manifest_is_refused_in_one_line(folder, data):
    (folder / "manifest.json").write_bytes(data)
    for read in (read_bake_folder, BakedSet.load):
        with pytest.raises(FabricError) as error:
            read(folder)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "name", ["Body.base_color.exr", "fabrics.usda", "Body.usdc", "manifest.json"]
)
def test_links_out_of_the_folder_are_not_followed(folder, name):
    outside = folder.parent / f"outside{Path(name).suffix}"
    (folder / name).rename(outside)
    (folder / name).symlink_to(outside)
    with pytest.raises(FabricError, match="is a link that leads out of its folder"):
        read_bake_folder(folder)
    # A link within the folder is one of its files.
    (folder / name).unlink()
    outside.rename(folder / f"moved{Path(name).suffix}")
    (folder / name).symlink_to(folder / f"moved{Path(name).suffix}")
    assert not read_bake_folder(folder).missing


@pytest.mark.parametrize(
    "name", ["look.json", "look.mtlx", "look_maps", "look_maps/Body.normal.*png"]
)
def test_a_look_is_not_written_through_a_link_out_of_the_folder(folder, name):
    write_materials(folder, None, PLAIN)
    outside = folder.parent / "outside"
    place = min(folder.glob(name))
    if place.is_dir():
        shutil.rmtree(place)
        outside.mkdir()
    else:
        place.unlink()
        outside.write_text("mine")
    place.symlink_to(outside)
    with pytest.raises(FabricError, match="is a link that leads out of its folder"):
        write_materials(folder, None, PLAIN)
    assert outside.is_dir() or outside.read_text() == "mine"


def test_layers_of_the_bake_that_refer_to_other_files_are_refused(folder):
    fabrics = Sdf.Layer.FindOrOpen(str(folder / "fabrics.usda"))
    text = fabrics.ExportToString()
    other = folder.parent / "other.usda"
    other.write_text('#usda 1.0\ndef "X" {}\n')
    (folder / "fabrics.usda").write_text(
        text + '\ndef "Evil" (references = @../other.usda@</X>) {}\n'
    )
    fabrics.Reload(force=True)
    with pytest.raises(FabricError, match=r"refers to '\.\./other\.usda'"):
        read_bake_folder(folder)


def test_a_mesh_that_names_a_picture_is_refused_before_it_is_packed(folder):
    stage = Usd.Stage.Open(str(folder / "Body.usdc"))
    prim = stage.GetDefaultPrim()
    prim.CreateAttribute("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath("../secret.exr"))
    stage.Save()
    package = folder / "look.usdz"
    with pytest.raises(FabricError, match=r"refers to '\.\./secret\.exr'"):
        write_materials(folder, None, Settings(fitted=False, targets={"usdz": package}))
    assert not package.exists()


def test_a_manifest_that_has_lost_a_lay_of_its_mesh_is_refused(folder):
    said = said_in(folder)
    del said["garments"]["Body"]["lays"][0]
    say(folder, said)
    with pytest.raises(FabricError, match="has 2 parts; the manifest says 1 lays"):
        write_materials(folder, None, PLAIN)
    assert not (folder / "look.usda").exists()


def test_a_texture_of_another_size_is_refused(folder):
    levels = [np.zeros((n, n, 3), np.float16) for n in (32, 16, 8, 4, 2, 1)]
    write_mip_exr(
        folder / "Body.base_color.exr", [lambda one=one: iter((one,)) for one in levels], 32,
        ("R", "G", "B"), np.float16, {},
    )  # fmt: skip
    with pytest.raises(FabricError, match="has 32 x 32 texels of 3 channels; the manifest says 64"):
        read_bake_folder(folder)


def test_a_map_that_has_lost_a_tile_is_no_map(tiled, tmp_path):
    shutil.copytree(tiled, tmp_path / "bake")
    (tmp_path / "bake" / "Body.base_color.1002.exr").unlink()
    made = write_materials(tmp_path / "bake", None, PLAIN)
    assert len(made.notes) == 1
    assert "Body.base_color.1002.exr is missing; a constant replaces it" in made.notes[0]


def places_of(value: object, place: tuple = ()) -> list[tuple]:
    """The places of all values in JSON."""
    found = [place]
    rows = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    for key, inner in rows:
        found += places_of(inner, (*place, key))
    return found


ODD = st.sampled_from(
    [
        None, True, -1, 0, 1e308, float("nan"), 10**400, "", "..", "../../../x", "/etc/passwd",
        "Body", "1001", "\0", "\ud800", "x" * 20_000, [], {}, [[]], [0, 0],
        {"file": "../secret.exr"}, ["../secret.exr"], [[0, 0], [0, 0]],
        {"1001": {"file": "../secret.exr"}},
    ]
)  # fmt: skip


@settings(max_examples=examples(60, 10_000))
@given(data=st.data())
def test_no_change_of_a_manifest_reads_or_writes_outside(baked, tmp_path, data):
    folder = tmp_path / "a" / "bake"
    if not folder.exists():
        shutil.copytree(baked, folder)
        (tmp_path / "secret.exr").write_bytes(b"secret")
        (tmp_path / "a" / "secret.exr").write_bytes(b"secret")
    said = said_in(baked)
    if data.draw(st.booleans()):
        for _ in range(data.draw(st.integers(1, 3))):
            places = [p for p in places_of(said) if p]
            place = data.draw(st.sampled_from(places))
            held = said
            for key in place[:-1]:
                held = held[key]
            way = data.draw(st.sampled_from(("put", "take", "rename", "swap")))
            if way == "take":
                del held[place[-1]]
            elif way == "rename" and isinstance(held, dict):
                name = data.draw(st.sampled_from(("../x", "/x", "a.b", "body", "con", "", "1002")))
                held[name] = held.pop(place[-1])
            elif way == "swap":
                other = data.draw(
                    st.sampled_from(list(held) if isinstance(held, dict) else range(len(held)))
                )
                held[place[-1]], held[other] = held[other], held[place[-1]]
            else:
                # A copy: the next change may put something into it.
                held[place[-1]] = copy.deepcopy(data.draw(ODD))
        (folder / "manifest.json").write_text(json.dumps(said), "utf-8", "surrogatepass")
    else:
        text = bytearray((baked / "manifest.json").read_bytes())
        at = data.draw(st.integers(0, len(text)))
        text[at : at + data.draw(st.integers(0, 8))] = data.draw(st.binary(max_size=8))
        (folder / "manifest.json").write_bytes(bytes(text))
    with suppress(FabricError):
        found = read_bake_folder(folder)
        for one in found.garments:
            paths = [one.mesh, *(p for files in one.textures.values() for p in files.values())]
            assert all(path.resolve().parent == folder.resolve() for path in paths)
        baked_set = BakedSet.load(folder)
        for one in found.garments:
            for name in one.textures:
                baked_set.read(one.name, name)
        if data.draw(st.integers(0, 49)) == 0:
            write_materials(folder, None, PLAIN)
    outside = everything(tmp_path, folder)
    assert {p.name: c for p, c in outside.items()} == {"secret.exr": b"secret"}
    assert len(outside) == 2
