"""The schema as other tools meet it: plain usd-core, with the plugin path and without."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from pxr import Sdf, Usd

from fabricusd.fabric import (
    BASES,
    MODELS,
    OBSERVERS,
    SURFACE_LAWS,
    Binding,
    Fabric,
    Thread,
    ThreadSet,
)
from fabricusd.schema import PLUGIN_PATH, attributes, load, save
from fabricusd.schema.generate import generate
from fabricusd.schema.plugin import VALIDATORS
from fabricusd.sides import Sides

TYPES = ("WovenFabric", "WovenThread")
DEFINITIONS = [*TYPES, "WovenBindingAPI"]


def definition(name: str) -> Usd.PrimDefinition:
    registry = Usd.SchemaRegistry()
    if name in TYPES:
        return registry.FindConcretePrimDefinition(name)
    return registry.FindAppliedAPIPrimDefinition(name)


def own_properties() -> list[tuple[str, str]]:
    return [
        (name, prop)
        for name in DEFINITIONS
        for prop in definition(name).GetPropertyNames()
        if prop.startswith(("fabric:", "thread:"))
    ]


def plain_usd(script: str, *arguments: str, plugin: bool, rules: bool = False) -> dict:
    """Run a script that has usd-core and, without `rules`, no fabricusd on its path."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH",)}
    environment.pop("PXR_PLUGINPATH_NAME", None)
    folders = [str(PLUGIN_PATH)] * plugin + [str(VALIDATORS)] * rules
    if folders:
        environment["PXR_PLUGINPATH_NAME"] = os.pathsep.join(folders)
    if rules:
        environment["PYTHONPATH"] = str(PLUGIN_PATH.parents[2])
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        capture_output=True, text=True, env=environment, cwd="/", check=True,
    )  # fmt: skip
    return json.loads(done.stdout)


LOOK = """
import json, sys
from pxr import Usd
stage = Usd.Stage.Open(sys.argv[1])
prim = stage.GetDefaultPrim()
thread = prim.GetChildren()[0]
fallback = Usd.Stage.CreateInMemory()
fallback = fallback.DefinePrim("/A", "WovenFabric").GetAttribute("fabric:warp:density").Get()
print(json.dumps({
    "defined": Usd.SchemaRegistry().FindConcretePrimDefinition("WovenFabric") is not None,
    "names": [str(p.GetTypeName()) for p in (prim, thread)],
    "typed": [p.IsA(Usd.Typed) for p in (prim, thread)],
    "fallback": fallback,
    "authored": stage.GetRootLayer().ExportToString(),
}))
"""


def test_a_stage_authored_here_opens_in_plain_usd_with_typed_prims(tmp_path):
    save(load("velvet"), tmp_path / "velvet.usda")
    seen = plain_usd(LOOK, str(tmp_path / "velvet.usda"), plugin=True)
    assert seen["defined"]
    assert seen["names"] == ["WovenFabric", "WovenThread"]
    assert seen["typed"] == [True, True]
    assert seen["fallback"] == 20.0


def test_without_the_plugin_it_still_opens_and_nothing_is_lost(tmp_path):
    save(load("velvet"), tmp_path / "velvet.usda")
    seen = plain_usd(LOOK, str(tmp_path / "velvet.usda"), plugin=False)
    assert not seen["defined"]
    assert seen["names"] == ["WovenFabric", "WovenThread"]
    assert seen["typed"] == [False, False]
    again = tmp_path / "again.usda"
    again.write_text(seen["authored"])
    assert load(again) == load("velvet")


VALIDATE = """
import json, sys
from pxr import Usd, UsdValidation
stage = Usd.Stage.Open(sys.argv[1])
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
errors = UsdValidation.ValidationContext(validators).Validate(stage)
print(json.dumps([error.GetName() for error in errors]))
"""
NEGATIVE = Path(__file__).parent / "bad" / "number_in_range.usda"


def test_the_plugin_path_leaves_validation_elsewhere_as_it_is():
    alone = "import sys; sys.modules['fabricusd'] = None" + VALIDATE
    assert "NumberInRange" not in plain_usd(alone, str(NEGATIVE), plugin=True)


def test_the_rules_run_in_a_program_that_never_heard_of_them():
    assert "NumberInRange" in plain_usd(VALIDATE, str(NEGATIVE), plugin=True, rules=True)


def test_the_plugin_folder_is_what_usd_gen_schema_makes_of_the_source():
    pytest.importorskip("jinja2")
    for name, text in generate().items():
        assert (PLUGIN_PATH / name).read_text() == text, f"{name} is stale; run `make schema`"


@pytest.mark.parametrize(("owner", "prop"), own_properties())
def test_every_attribute_has_a_doc_and_says_its_unit(owner, prop):
    doc = definition(owner).GetPropertyDocumentation(prop)
    assert len(doc) > 8
    if definition(owner).GetSpecType(prop) == Sdf.SpecTypeAttribute:
        assert "Unit: " in doc


@pytest.mark.parametrize(("owner", "prop"), own_properties())
def test_every_attribute_has_a_fallback_and_every_token_its_allowed_values(owner, prop):
    if definition(owner).GetSpecType(prop) != Sdf.SpecTypeAttribute:
        return
    attribute = definition(owner).GetAttributeDefinition(prop)
    assert attribute.GetFallbackValue() is not None
    if attribute.GetTypeName() == "token" and prop != "fabric:binding:uvSet":
        allowed = list(attribute.GetMetadata("allowedTokens"))
        names = {
            "fabric:surfaceLaw": SURFACE_LAWS,
            "fabric:model": MODELS,
            "thread:model": ("inherit", *MODELS),
            "thread:targetColor:basis": BASES,
            "thread:targetColor:observer": tuple(str(field) for field in OBSERVERS),
        }
        assert allowed == list(names[prop])


@pytest.mark.parametrize(
    "entry",
    [*attributes.THREAD, *attributes.FABRIC, *attributes.SIDES, *attributes.BINDING,
     *attributes.thread_set("warp"), *attributes.thread_set("weft")],
    ids=lambda entry: entry.name,
)  # fmt: skip
def test_fallbacks_and_types_agree_with_the_dataclasses(entry):
    owner = (
        "WovenBindingAPI"
        if entry.owner is Binding
        else ("WovenThread" if entry.owner is Thread else "WovenFabric")
    )
    attribute = definition(owner).GetAttributeDefinition(entry.name)
    assert attribute.GetTypeName() == entry.type_name
    fallback = attributes.to_si(attribute.GetFallbackValue(), entry)
    made = {
        Thread: Thread(),
        ThreadSet: ThreadSet(),
        Fabric: Fabric(),
        Sides: Sides(),
        Binding: Binding(fabric=Fabric()),
    }[entry.owner]
    if fallback is None:
        assert getattr(made, entry.field) is None
    else:
        assert fallback == pytest.approx(getattr(made, entry.field), rel=1e-15)


def test_documented_degrees_are_read_as_radians():
    assert load("linen_plain").threads["Linen"].gamma_surface == pytest.approx(math.radians(12))
