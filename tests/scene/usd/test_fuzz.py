"""Damaged USD scenes: each is read, with notes, or refused in one line; none hangs or swallows
memory."""

from __future__ import annotations

import re
import shutil

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.bake.bake import plan
from fabricusd.bake.job import Settings
from fabricusd.scene.read import read_scene
from tests.conftest import CHECKOUT
from tests.fuzz import examples, mutated, refusal

WHOLE = CHECKOUT / "tests" / "cases" / "usd_everything"
TEXT = (WHOLE / "scene.usda").read_text()
LINES = TEXT.splitlines()
VALUES = [k for k, line in enumerate(LINES) if re.search(r"\S = \S", line) and k > 1]
PATHS = sorted({*re.findall(r"<(/[^>]*)>", TEXT), "/", "/World", "/World/PI", "/x"})

NUMBERS = ["0", "1", "-1", "2", "1e30", "-1e30", "1e-30", "1e308", "nan", "inf", "-inf", "0.5",
           "2147483647", "-2147483648", "100000"]  # fmt: skip
SCALARS = st.sampled_from(
    [*NUMBERS, "None", '"a"', '""', '"none"', "true", "@tex.png@", "@lost.usda@", "[]", "()", "{}",
     "<>", "AnimationBlock"]
) | st.sampled_from(PATHS).map(lambda path: f"<{path}>")  # fmt: skip
TUPLES = st.builds(
    lambda row: f"({', '.join(row)})", st.lists(st.sampled_from(NUMBERS), min_size=1, max_size=4)
)
ARRAYS = st.builds(
    lambda row: f"[{', '.join(row)}]", st.lists(SCALARS | TUPLES, min_size=0, max_size=7)
)
TYPES = st.sampled_from(
    ["int", "float", "double", "bool", "string", "token", "asset", "int[]", "float[]", "double[]",
     "token[]", "float2", "float3[]", "double3[]", "point3f[]", "quath[]", "quatf[]", "matrix4d",
     "matrix4d[]", "texCoord2f[]", "color3f", "half", "int64[]", "uchar[]", "string[]", "rel"]
)  # fmt: skip
KINDS = st.sampled_from(
    ["Mesh", "Xform", "Scope", "Camera", "PointInstancer", "GeomSubset", "SphereLight", "DomeLight",
     "Skeleton", "SkelRoot", "SkelAnimation", "BlendShape", "WovenFabric", "WovenThread",
     "Material", "Shader", "Cube", "Volume", "MeshLight", ""]
)  # fmt: skip


def _list(line: str) -> tuple[str, list[str]] | None:
    """What comes before an array's value in a line, and the array's parts."""
    found = re.match(r"(.*= )\[(.*)\](.*)$", line)
    if not found:
        return None
    return found[1], re.findall(r"\((?:[^()]|\([^()]*\))*\)|[^,()\s][^,()]*", found[2])


@st.composite
def scenes(draw: st.DrawFn) -> str:
    """The whole scene with up to five lines changed: values, types, lengths, paths, specifiers."""
    lines = list(LINES)
    for _ in range(draw(st.integers(1, 5))):
        at = draw(st.sampled_from(VALUES))
        line = lines[at]
        match draw(st.integers(0, 8)):
            case 0 | 1:
                value = draw(SCALARS | TUPLES | ARRAYS)
                line = re.sub(r"= .*$", lambda _, v=value: f"= {v}", line)
            case 2:
                line = re.sub(r"^(\s*(?:uniform )?)[\w\[\]]+ ", rf"\g<1>{draw(TYPES)} ", line)
            case 3 | 4 if (found := _list(line)) is not None:
                before, parts = found
                size = draw(st.integers(0, 2 * len(parts) + 1))
                line = f"{before}[{', '.join((parts * 3)[:size])}]"
            case 5:
                at = draw(st.sampled_from([k for k, x in enumerate(lines) if "<" in x]))
                path = draw(st.sampled_from(PATHS))
                line = re.sub(r"<[^>]*>", f"<{path}>", lines[at])
            case 6:
                defined = [k for k, x in enumerate(lines) if re.match(r"\s*(def|over|class) ", x)]
                at = draw(st.sampled_from(defined))
                word = draw(st.sampled_from(["def", "over", "class"]))
                line = re.sub(
                    r"(def|over|class)( \w+)?", f"{word} {draw(KINDS)}", lines[at], count=1
                )
            case 7:
                one = draw(st.sampled_from(NUMBERS))
                numbers = list(re.finditer(r"(?<=[ (\[])-?[\d.]+(?=[,)\]]|$)", line))
                if numbers:
                    spot = draw(st.sampled_from(numbers))
                    line = line[: spot.start()] + one + line[spot.end() :]
            case _:
                line = ""
        lines[at] = line
    return "\n".join(lines)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("scenes")
    for file in WHOLE.iterdir():
        shutil.copy(file, place)
    # Not part of what one input costs.
    read_scene(place / "scene.usda")
    plan(place / "scene.usda", Settings(udim=True))
    return place


def read_and_plan(path):
    read_scene(path, time_code=2.0, complexity="medium")
    plan(path, Settings(udim=True))


@settings(max_examples=examples(60, 10_000))
@given(text=scenes())
def test_a_scene_with_wrong_values_types_lengths_or_paths_is_read_or_refused(folder, text):
    path = folder / "damaged.usda"
    path.write_text(text)
    refusal(read_and_plan, path)


@settings(max_examples=examples(30, 10_000))
@given(data=mutated(TEXT.encode()))
def test_a_scene_with_damaged_bytes_is_read_or_refused(folder, data):
    path = folder / "damaged.usda"
    path.write_bytes(data)
    refusal(read_and_plan, path)
