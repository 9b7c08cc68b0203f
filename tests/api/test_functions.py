"""The functions of the package's top level, by the examples of their docstrings and of the page."""

from __future__ import annotations

import doctest
import inspect
import math
import pickle
from importlib import import_module
from pathlib import Path

import pytest

import fabricusd
from fabricusd.api import functions
from fabricusd.errors import FabricError

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"


def examples_of(thing: object, name: str) -> None:
    """Run the examples of a docstring; the test fails where one prints something else."""
    found = doctest.DocTestFinder(recurse=False).find(thing, name, globs={})
    assert any(test.examples for test in found)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for test in found:
        runner.run(test)
    assert runner.summarize(verbose=False).failed == 0


@pytest.mark.parametrize("name", ["render", "preview", "fit"])
def test_the_example_of_a_function_runs(name):
    thing = fabricusd.render if name == "render" else getattr(functions, name)
    examples_of(thing, name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bake", "material"])
def test_the_example_of_a_long_function_runs(name):
    examples_of(getattr(functions, name), name)


@pytest.mark.slow
def test_the_examples_of_the_page_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text(encoding="utf-8")
    parts = text.split("```python\n")[1:]
    assert len(parts) >= 5
    source = "\n".join(part.split("```")[0] for part in parts)
    test = doctest.DocTestParser().get_doctest(source, {}, "python.md", str(PAGE), 0)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    runner.run(test)
    assert runner.summarize(verbose=False).failed == 0


def test_a_folder_that_is_a_function_stays_a_module():
    assert "settings" in inspect.signature(fabricusd.bake).parameters
    assert "shape" in inspect.signature(fabricusd.preview).parameters
    import_module("fabricusd.bake.job")
    assert fabricusd.bake.job.Settings().resolution == 1024
    assert pickle.loads(pickle.dumps(fabricusd.bake)) is fabricusd.bake
    for name in fabricusd.__all__:
        assert getattr(fabricusd, name) is not None


def test_a_setting_that_is_unknown_is_told_before_any_work(tmp_path):
    with pytest.raises(FabricError, match=r"setting 'resolutoin' is unknown.*resolution"):
        fabricusd.bake("nothing.usda", tmp_path, resolutoin=64)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fabricusd.Thread(gamma_surface=12), "gamma_surface is 12.0 radians.*12° is 0.209"),
        (
            lambda: fabricusd.Thread(gamma_volume=24.0),
            "at most 3.14159 and above 0 radians; 24° is 0.419",
        ),
        (lambda: fabricusd.Fabric(masking_width=20), "masking_width is 20 radians.*20° is 0.349"),
        (
            lambda: fabricusd.TangentCurve(angles=(-30, 30)),
            "curve angle 0 is -30 radians.*1.5708 radians; -30° is -0.524",
        ),
    ],
)
def test_an_angle_in_degrees_is_told_what_it_is_in_radians(make, words):
    with pytest.raises(FabricError, match=words):
        make()


def test_an_angle_that_is_no_number_of_degrees_gets_no_such_hint():
    with pytest.raises(FabricError) as told:
        fabricusd.Thread(gamma_surface=-math.pi / 4)
    assert "°" not in str(told.value)
