"""Setting values: by attribute and by word, over all or in a variant, all or nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd

from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric, Thread, ThreadSet
from fabricusd.schema import load, save, write_binding
from fabricusd.schema.edit import parse_change, set_values
from fabricusd.weaves.cloth import parse_weight, weight
from fabricusd.weaves.yarn import parse_count

CLOTH = Fabric(
    name="Cloth",
    threads={"Blue": Thread(thickness=4e-4), "White": Thread(thickness=4e-4)},
    warp=ThreadSet(sequence=(0,)),
    weft=ThreadSet(sequence=(1,)),
)


@pytest.fixture(params=[".usda", ".usdc", ".usd"])
def layer(tmp_path: Path, request) -> Path:
    save(CLOTH, tmp_path / f"cloth{request.param}")
    return tmp_path / f"cloth{request.param}"


@pytest.fixture
def text(tmp_path: Path) -> Path:
    save(CLOTH, tmp_path / "cloth.usda")
    return tmp_path / "cloth.usda"


def change(source, *texts: str, variant: str = "", write: bool = True) -> tuple[str, ...]:
    changes = [parse_change(each) for each in texts]
    return set_values(source, changes, variant=variant, write=write)


def test_an_attribute_is_set_by_its_whole_name_and_by_its_last_word(layer: Path) -> None:
    change(layer, "thread:ior=1.4", "gammaSurface=7", "maskingWidth=15", "opaque=yes")
    fabric = load(layer)
    assert {thread.ior for thread in fabric.thread_list} == {1.4}
    assert fabric.thread_list[0].gamma_surface == pytest.approx(0.12217, abs=1e-5)
    assert fabric.opaque


def test_a_value_is_set_on_one_thread_or_one_set(text: Path) -> None:
    change(text, "Blue.ior=1.7", "weft.ior=1.2", "warp.density=31", "weft.coverage=0.25")
    fabric = load(text)
    assert (fabric.threads["Blue"].ior, fabric.threads["White"].ior) == (1.7, 1.2)
    assert (fabric.warp.density, fabric.weft.density) == (3100, 2000)
    assert fabric.weft.coverage == 0.25
    change(f"{text}:/Cloth/White", "ior=1.9", "colour=#ff0000")
    assert load(text).threads["White"].ior == 1.9
    assert load(text).threads["Blue"].color == CLOTH.threads["Blue"].color


def test_lists_and_tokens_are_read(text: Path) -> None:
    change(text, "fabric:warp:threads=0,1", "weave:rows=1100,0011", "fabric:model=conserving")
    change(text, "curve:angles=-30,30")
    fabric = load(text)
    assert fabric.warp.sequence == (0, 1)
    assert fabric.weave.cells.shape == (4, 2)
    assert fabric.model == "conserving"
    assert fabric.thread_list[0].curve.steepest == pytest.approx(0.5236, abs=1e-4)


def test_a_colour_brings_the_albedo_along_at_its_ratio(text: Path) -> None:
    before = load(text).threads["Blue"]
    change(text, "warp.colour=0.5,0.25,0")
    thread = load(text).threads["Blue"]
    ratio = max(before.albedo) / max(before.color)
    assert thread.color == (0.5, 0.25, 0.0)
    assert thread.albedo == pytest.approx((0.5 * ratio, 0.25 * ratio, 0.0))


def test_roughness_widens_both_lobes_alike(text: Path) -> None:
    before = load(text).thread_list[0]
    change(text, "roughness=0.5")
    thread = load(text).thread_list[0]
    assert thread.gamma_surface == pytest.approx(0.25 / 2**0.5)
    assert thread.gamma_volume / thread.gamma_surface == pytest.approx(
        before.gamma_volume / before.gamma_surface
    )


def test_weight_yarn_and_densities_are_in_the_units_of_the_trade(text: Path) -> None:
    change(text, "warp.yarn=Ne 7", "weft.yarn=Ne 8", "ends-per-inch=68", "picks-per-cm=17")
    fabric = load(text)
    assert fabric.threads["Blue"].linear_density == pytest.approx(parse_count("Ne 7"))
    assert fabric.warp.density == pytest.approx(68 / 0.0254)
    assert fabric.weft.density == pytest.approx(1700)
    change(text, "weight=14oz")
    assert weight(load(text)).total == pytest.approx(parse_weight("14oz"))
    assert load(text).warp.density == fabric.warp.density


def test_a_weight_is_set_after_what_was_set_before_it(text: Path) -> None:
    change(text, "ends-per-cm=40", "weight=200gsm", "thread:ior=1.4")
    assert weight(load(text)).total == pytest.approx(0.2)


def test_a_binding_has_grain_and_scale(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "s.usda"))
    save(CLOTH, tmp_path / "cloth.usda")
    stage.DefinePrim("/Cloth").GetReferences().AddReference("./cloth.usda")
    write_binding(stage.DefinePrim("/Shirt", "Mesh"), "/Cloth", Binding(fabric=CLOTH))
    stage.GetRootLayer().Save()
    change(f"{tmp_path / 's.usda'}:/Shirt", "grain=45", "scale=300")
    stage = Usd.Stage.Open(str(tmp_path / "s.usda"))
    shirt = stage.GetPrimAtPath("/Shirt")
    assert shirt.GetAttribute("fabric:binding:rotation").Get() == 45
    assert shirt.GetAttribute("fabric:binding:millimetersPerUnit").Get() == 300


def test_a_referenced_fabric_is_overridden_and_its_own_layer_stays(text: Path) -> None:
    scene = text.with_name("scene.usda")
    stage = Usd.Stage.CreateNew(str(scene))
    stage.DefinePrim("/Denim").GetReferences().AddReference("./cloth.usda")
    stage.GetRootLayer().Save()
    before = text.read_text()
    change(f"{scene}:/Denim", "weft.ior=1.3")
    assert load(f"{scene}:/Denim").threads["White"].ior == 1.3
    assert text.read_text() == before
    assert "thread:ior" in scene.read_text()


def test_a_variant_holds_the_new_value_and_the_others_the_old_one(text: Path) -> None:
    change(text, "warp.colour=1,0,0", "thread:ior=1.4", variant="claret")
    change(text, "warp.colour=0,1,0", variant="lime")
    assert load(text).threads["Blue"].color == (0, 1, 0)
    stage = Usd.Stage.Open(str(text))
    variants = stage.GetPrimAtPath("/Cloth").GetVariantSet("fabricVariant")
    found = {}
    for name in variants.GetVariantNames():
        variants.SetVariantSelection(name)
        thread = stage.GetPrimAtPath("/Cloth/Blue")
        found[name] = (
            tuple(thread.GetAttribute("thread:color").Get()),
            tuple(thread.GetAttribute("thread:albedo").Get()),
            thread.GetAttribute("thread:ior").Get(),
        )
    old = CLOTH.threads["Blue"]
    assert found == {
        "original": (old.color, old.albedo, old.ior),
        "claret": ((1, 0, 0), (0.4, 0, 0), 1.4),
        # A new variant begins as a copy of the one that was selected.
        "lime": ((0, 1, 0), (0, 0.4, 0), 1.4),
    }


def test_a_variant_of_a_set_of_its_own_name(text: Path) -> None:
    change(text, "thread:ior=1.4", variant="finish=matt")
    stage = Usd.Stage.Open(str(text))
    sets = stage.GetPrimAtPath("/Cloth").GetVariantSets()
    assert sets.GetNames() == ["finish"]
    assert sets.GetVariantSelection("finish") == "matt"


def test_a_dry_run_and_a_text_layer_keep_the_file(tmp_path: Path) -> None:
    save(CLOTH, tmp_path / "a.usda")
    (tmp_path / "cloth.usd").write_bytes((tmp_path / "a.usda").read_bytes())
    before = (tmp_path / "cloth.usd").read_bytes()
    change(tmp_path / "cloth.usd", "thread:ior=1.4", write=False)
    assert (tmp_path / "cloth.usd").read_bytes() == before
    change(tmp_path / "cloth.usd", "thread:ior=1.4")
    assert (tmp_path / "cloth.usd").read_bytes().startswith(b"#usda")


BAD = {
    "iorr=1.3": r"iorr is not an attribute of WovenFabric /Cloth \(did you mean 'ior'\?\)",
    "density=3": "density may be fabric:warp:density or fabric:weft:density",
    "thread:ior=0.5": r"/Cloth/Blue thread:ior is 0.5; it must be at least 1",
    "ior=x": "thread:ior is 'x'; it must be a number",
    "ior=1,2": "thread:ior is '1,2'; it must be a number",
    "warp:threads=0.5": "it must be whole numbers",
    "warp:threads=7": r"it must be from 0 to 1, the fabric has 2 threads",
    "opaque=maybe": "it must be true or false",
    "fabric:model=odd": "is 'odd'; it must be one of",
    "colour=blu": r"colour is 'blu' \(did you mean 'blue'\?\); it must be #rrggbb",
    "roughness=1.5": "roughness is '1.5'; it must be above 0 and at most 1",
    "weight=7": "weight is '7'; write it as in 14oz",
    "ends-per-cm=0": "ends-per-cm is '0'; it must be above 0",
    "wrp.ior=2": r"wrp. is no set or thread \(did you mean 'warp'\?\)",
}


@pytest.mark.parametrize("text_", BAD)
def test_a_slip_is_refused_and_the_file_stays_as_it_is(text: Path, text_: str) -> None:
    before = text.read_bytes()
    with pytest.raises(FabricError, match=BAD[text_]):
        change(text, "thread:isotropic=0.9", text_)
    assert text.read_bytes() == before
    # The process's layer is as it was, too.
    assert load(text).thread_list[0].isotropic == CLOTH.thread_list[0].isotropic


@pytest.mark.parametrize("text_", ["x", "=3", "ior=", "  =  ", ""])
def test_what_sets_nothing_is_refused(text_: str) -> None:
    with pytest.raises(FabricError, match=r"sets nothing; write NAME=VALUE"):
        parse_change(text_)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("velvet", "velvet is a preset; make a layer of it first: fabricusd new --preset velvet"),
        ("x.usdz", r"x\.usdz cannot be changed; it must be \.usda, \.usdc, \.usd"),
        ("nowhere.usda", "nowhere.usda does not exist"),
    ],
)
def test_what_is_no_layer_of_the_user_is_refused(source: str, said: str) -> None:
    with pytest.raises(FabricError, match=said):
        change(source, "thread:ior=1.4")


def test_a_thread_of_both_sets_cannot_be_changed_in_one(tmp_path: Path) -> None:
    save(Fabric(name="Plain"), tmp_path / "p.usda")
    with pytest.raises(FabricError, match="thread Thread is in warp and weft"):
        change(tmp_path / "p.usda", "warp.ior=1.4")


def test_a_variant_without_a_name_is_refused(text: Path) -> None:
    with pytest.raises(FabricError, match="--variant 'a b' is not a name"):
        change(text, "thread:ior=1.4", variant="a b")


def test_a_value_in_a_sublayer_that_hides_the_new_one_is_refused(tmp_path: Path) -> None:
    """A variant of the layer is weaker than what a sublayer of it states."""
    save(CLOTH, tmp_path / "cloth.usda")
    (tmp_path / "over.usda").write_text(
        '#usda 1.0\n(\n    defaultPrim = "Cloth"\n    subLayers = [@./cloth.usda@]\n)\n'
    )
    with pytest.raises(FabricError, match="thread:ior is stated in a place that hides the new va"):
        change(tmp_path / "over.usda", "thread:ior=1.4", variant="v")
