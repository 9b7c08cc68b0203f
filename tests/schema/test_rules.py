"""Each rule finds its fault, in its own sample, through every door."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from pxr import Usd, UsdValidation

from fabricusd import FabricError
from fabricusd.schema import check, load, preset_names
from fabricusd.schema.findings import Finding
from fabricusd.schema.rules.rules import RULES
from fabricusd.schema.validators import PLUGIN_NAME

BAD = Path(__file__).parent / "bad"
NAMES = [rule.function.__name__ for rule in RULES]
OF_FABRICS = [
    rule
    for rule in RULES
    if rule.severity == "error" and rule.schema_types != ("FabricusdWovenBindingAPI",)
]


@cache
def found_in(sample: Path) -> tuple[Finding, ...]:
    """What `check` finds in a sample, read once for all the tests here."""
    return tuple(check(str(sample)))


@pytest.mark.parametrize("rule", RULES, ids=NAMES)
def test_a_rule_finds_the_fault_in_the_sample_named_after_it(rule):
    findings = found_in(BAD / f"{rule.function.__name__}.usda")
    assert rule.name in {finding.rule for finding in findings}


@pytest.mark.parametrize("rule", RULES, ids=NAMES)
def test_a_rule_finds_nothing_in_the_samples_of_other_faults(rule):
    # Of two faults that cannot be apart, both are told: a circle of relationships has no thread.
    together = {
        "ThreadsExist": {"relationship_acyclic"},
        "BelowDefsAlone": {"bound_fabric_defined"},
    }
    for sample in BAD.glob("*.usda"):
        if sample.stem == rule.function.__name__ or sample.stem in together.get(rule.name, ()):
            continue
        assert rule.name not in {finding.rule for finding in found_in(sample)}, sample.name


def test_there_is_one_bad_sample_for_each_rule():
    assert sorted(path.stem for path in BAD.glob("*.usda")) == sorted(NAMES)


@pytest.mark.parametrize("rule", RULES, ids=NAMES)
def test_usd_validators_report_what_check_reports(rule):
    validator = UsdValidation.ValidationRegistry().GetOrLoadValidatorByName(
        f"{PLUGIN_NAME}:{rule.name}"
    )
    stage = Usd.Stage.Open(str(BAD / f"{rule.function.__name__}.usda"))
    # Of a stage USD passes over what is not defined, for which there is a rule.
    prims = list(Usd.PrimRange.Stage(stage, Usd.PrimAllPrimsPredicate))
    reported = UsdValidation.ValidationContext([validator]).Validate(prims)
    ours = [f for f in check(str(BAD / f"{rule.function.__name__}.usda")) if f.rule == rule.name]
    # USD looks at several prims at once.
    assert sorted(e.GetMessage() for e in reported) == sorted(
        f"{f.prim} {f.property} {f.problem}" for f in ours
    )


@pytest.mark.parametrize("name", preset_names())
def test_presets_are_clean(name):
    assert check(name) == []


@pytest.mark.parametrize("rule", OF_FABRICS, ids=[rule.name for rule in OF_FABRICS])
def test_reading_a_fabric_with_an_error_raises_the_same_words(rule):
    sample = str(BAD / f"{rule.function.__name__}.usda")
    finding = next(f for f in check(sample) if f.severity == "error")
    with pytest.raises(FabricError, match=re.escape(finding.problem)):
        load(sample)


@pytest.mark.parametrize(
    ("attribute", "text"),
    [
        ("double thread:ior", "nan"),
        ("double thread:ior", "inf"),
        ("double thread:isotropic", "1.5"),
        ("double thread:gammaSurface", "0"),
        ("double thread:gammaVolume", "181"),
        ("double thread:thickness", "-0.1"),
        ("color3d thread:albedo", "(0.1, -0.1, 0.1)"),
        ("color3d thread:color", "(0.1, nan, 0.1)"),
        ("double[] thread:curve:angles", "[0, nan]"),
        ("double[] thread:curve:positions", "[0, nan]"),
        ("double[] thread:curve:positions", "[1, 1]"),
        ("double[] thread:curve:positions", "[]"),
    ],
)
def test_a_thread_value_out_of_range_is_named_with_its_place(attribute, text, tmp_path):
    path = tmp_path / "cloth.usda"
    body = f'def WovenThread "Warp"\n{{\n{attribute} = {text}\n}}'
    path.write_text(f'#usda 1.0\ndef WovenFabric "Cloth"\n{{\n{body}\n}}\n')
    name = attribute.split()[1]
    with pytest.raises(FabricError, match=rf"/Cloth/Warp .*{name}.*must"):
        load(path)


@pytest.mark.parametrize(
    ("attribute", "text"),
    [
        ("double fabric:warp:density", "-20"),
        ("double fabric:weft:density", "0"),
        ("double fabric:warp:density", "nan"),
        ("double fabric:warp:density", "None"),
        ("double fabric:warp:density.timeSamples", "{ 1: 20 }"),
        ("double fabric:warp:density.connect", "</Cloth/Warp.thread:ior>"),
        ("string[] fabric:weave:rows", "None"),
        ("double fabric:warp:coverage", "-0.5"),
        ("double fabric:weft:coverage", "1.01"),
        ("double fabric:maskingWidth", "0"),
        ("int[] fabric:warp:threads", "[]"),
        ("int[] fabric:warp:threads", "[0, -1]"),
        ("string[] fabric:weave:rows", "[]"),
        ("string[] fabric:weave:rows", '[""]'),
        ("string[] fabric:weave:rows", '["10", "0"]'),
        ("string[] fabric:weave:rows", '["1X"]'),
        ("uniform token fabric:model", '"velours"'),
        ("double[] fabric:sides:gap", "[0.1, 0.2]"),
        ("double[] fabric:sides:forward", "[1.5]"),
        ("double[] fabric:sides:surface", "[nan]"),
        ("rel fabric:threads", "</Nowhere>"),
        ("rel fabric:back", "</Cloth>"),
        ("rel fabric:back", "</Nowhere>"),
    ],
)
def test_a_fabric_value_out_of_range_is_named_with_its_place(attribute, text, tmp_path):
    path = tmp_path / "cloth.usda"
    body = f'{attribute} = {text}\ndef WovenThread "Warp" {{ }}'
    path.write_text(f'#usda 1.0\ndef WovenFabric "Cloth"\n{{\n{body}\n}}\n')
    name = attribute.split()[-1].partition(".")[0]
    with pytest.raises(FabricError, match=rf"/Cloth {name}.*must"):
        load(path)


def test_every_problem_says_what_would_be_accepted():
    for sample in BAD.glob("*.usda"):
        for finding in found_in(sample):
            if finding.severity == "error":
                assert "must" in finding.problem, finding


@pytest.mark.parametrize("written", ["mystery thread:ior = 3", "float thread:curve:positions = 3"])
def test_a_value_of_a_wrong_type_is_a_finding_of_every_rule(written, tmp_path):
    path = tmp_path / "cloth.usda"
    thread = f'def WovenThread "Warp"\n{{\n{written}\n}}'
    path.write_text(f'#usda 1.0\ndef WovenFabric "Cloth"\n{{\n{thread}\n}}\n')
    assert "PropertyTypeMatches" in {finding.rule for finding in check(str(path))}


def test_bounds_are_told_in_the_unit_of_the_file(tmp_path):
    path = tmp_path / "cloth.usda"
    thread = 'def WovenThread "Warp"\n{\ndouble thread:gammaSurface = 200\n}'
    path.write_text(f'#usda 1.0\ndef WovenFabric "Cloth"\n{{\n{thread}\n}}\n')
    with pytest.raises(FabricError, match=r"is 200; it must be at most 180 and above 0 degrees"):
        load(path)
