"""The fabric that a page's changes make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, Thread, Weave
from fabricusd.preview.page.threads import NUMBERS, YARN, shown_numbers, thread_controls
from fabricusd.preview.serve import wanted
from fabricusd.preview.serve.wanted import changed

TWO = Fabric(
    threads={"Warp": Thread(albedo=(0.1, 0.2, 0.3)), "Weft": Thread(gamma_surface=0.3)},
    weave=Weave(np.array([[1, 0, 0], [0, 1, 0]], bool), "mine"),
)


def numbers_of(fabric: Fabric) -> list[list[float]]:
    return [control["values"] for control in thread_controls(fabric)]


def test_the_page_s_own_numbers_change_nothing():
    for fabric in (TWO, replace(TWO, model="conserving")):
        said = {"threads": numbers_of(fabric), "weave": "10/01/00", "coverage": [-1, -1]}
        assert changed(fabric, said) == fabric


STATED_TOO = {
    "cv": ("unevenness_length",), "shade": ("unevenness_length",),
    "slub": ("slub_length", "slub_spacing"),
}  # fmt: skip
"""Fields that a number of uneven yarn brings along, by the number's name."""


@pytest.mark.parametrize("model", ["microcylinder", "conserving"])
def test_each_number_changes_its_own_field_and_no_other(model):
    fabric = replace(TWO, model=model)
    numbers = shown_numbers(fabric, fabric.threads["Warp"])
    assert ("gain" in {n.name for n in numbers}) == (model == "conserving")
    for k, number in enumerate(numbers):
        said = numbers_of(fabric)
        low, high = number.range_of(fabric.threads["Warp"], model == "conserving")
        said[0][k] = low + 0.75 * (high - low)
        if number.name == "plies":
            said[0][k] = round(said[0][k])
        found = changed(fabric, {"threads": said})
        assert found.threads["Weft"] == fabric.threads["Weft"]
        assert numbers_of(found)[0] == pytest.approx(said[0], rel=1e-12)
        held = getattr(found.threads["Warp"], number.field)
        own = fabric.threads["Warp"]
        back = {
            name: getattr(own, name) for name in (number.field, *STATED_TOO.get(number.name, ()))
        }
        assert replace(found.threads["Warp"], **back) == fabric.threads["Warp"]
        assert held != back[number.field]


def test_unevenness_that_needs_a_length_takes_the_one_that_is_shown():
    said, names = numbers_of(TWO), [n.name for n in shown_numbers(TWO, TWO.threads["Warp"])]
    said[0][names.index("cv")] = 12.0
    said[0][names.index("slub")] = 0.5
    thread = changed(TWO, {"threads": said}).threads["Warp"]
    assert (thread.unevenness_cv, thread.slub_amount) == pytest.approx((0.12, 0.5))
    lengths = thread.unevenness_length, thread.slub_length, thread.slub_spacing
    assert lengths == pytest.approx((0.01, 0.02, 0.1))
    assert changed(TWO, {"threads": numbers_of(TWO)}) == TWO


def test_densities_are_per_centimetre():
    found = changed(TWO, {"density": [24.0, -1]})
    assert (found.warp.density, found.weft.density) == (2400.0, TWO.weft.density)


def test_a_changed_thread_forgets_the_colour_it_was_made_for():
    dyed = replace(TWO, threads={"Warp": Thread(target_basis="opaque"), "Weft": Thread()})
    said = numbers_of(dyed)
    said[0][0] = 0.7
    assert changed(dyed, {"threads": said}).threads["Warp"].target_basis == "none"
    assert changed(dyed, {"threads": numbers_of(dyed)}).threads["Warp"].target_basis == "opaque"


def test_weave_and_coverage_are_changed():
    found = changed(TWO, {"weave": "11/01", "coverage": [0.25, -1]})
    assert found.weave.cells.tolist() == [[True, False], [True, True]]
    assert (found.warp.coverage, found.weft.coverage) == (0.25, None)


@pytest.mark.parametrize(
    ("said", "problem"),
    [
        ({"threads": [[0.1]]}, "are 1 lists of numbers; there must be 2"),
        ({"threads": [[0.1], [0.1]]}, "thread Warp has 1 numbers; it must have 19"),
        ({"threads": [["x"] * 19, [0.1] * 19]}, "threads 0 is not a number"),
        ({"threads": [[0.5] * 19, [0.1] * 19]}, "thread Warp ior is 0.5; it must be from 1 to 3"),
        ({"threads": [3, 4]}, "threads 0 is not a list of numbers"),
        ({"weave": "10/1"}, r"weave \[1\] has 1 characters; it must have 2"),
        ({"weave": "12"}, "it must be 0"),
        ({"coverage": [0.9, 0.9]}, "coverage of warp and weft together is 1.8"),
        ({"coverage": [0.9]}, "coverage has 1 numbers; it must have 2"),
        ({"density": [0.0, 5.0]}, "density of the warp is not a number from 0.5 to 400"),
        ({"coverage": [-0.5, 0.5]}, "coverage of the warp is not a number from 0 to 1"),
    ],
)
def test_what_makes_no_fabric_is_refused(said, problem):
    with pytest.raises(FabricError, match=problem):
        changed(TWO, said)


def test_a_weave_that_is_too_large_is_refused(monkeypatch):
    monkeypatch.setattr(wanted, "MOST_CELLS", 9)
    with pytest.raises(FabricError, match="has 12 cells; it must have at most 9"):
        changed(TWO, {"weave": "/".join(["010"] * 4)})
    with pytest.raises(FabricError, match="is larger than 9 cells"):
        changed(TWO, {"weave": "0" * 19})


def test_every_number_has_a_name_of_its_own():
    every = shown_numbers(replace(TWO, model="conserving"), TWO.threads["Warp"])
    assert len({n.name for n in every}) == len(every) == len(NUMBERS) + 2 + len(YARN)
