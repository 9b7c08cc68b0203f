"""A light is one module; one that is missing or half made is an error at import."""

from __future__ import annotations

import subprocess
import sys

import pytest

from fabricusd.reference.lights.kinds import KINDS
from fabricusd.scene import light_kinds


def test_every_kind_of_a_scene_has_its_module():
    assert list(KINDS) == list(range(len(light_kinds.KINDS)))
    assert [m.__name__.rpartition(".")[2] for m in KINDS.values()] == list(light_kinds.NUMBERS)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("k.KINDS += (k.LightKind(name='tube', usd=('Tube',)),)", "no module for the lights tube"),
        ("import fabricusd.kernels; sys.modules['fabricusd.reference.lights.kinds.rect'] = "
         "types.SimpleNamespace(__name__='rect', KIND=2, fill=1)", "rect has no irradiance"),
        ("sys.modules['fabricusd.reference.lights.kinds.rect'] = types.SimpleNamespace("
         "__name__='rect', KIND=3, fill=1, irradiance=1, sample=1, meet=1)", "have the same KIND"),
    ],
)  # fmt: skip
def test_a_kind_that_is_forgotten_or_half_made_is_an_error_at_import(change, words):
    code = (
        "import sys, types\nfrom fabricusd.scene import light_kinds as k\n"
        f"{change}\nimport fabricusd.reference.lights.kinds"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert words in done.stderr.strip().splitlines()[-1]
