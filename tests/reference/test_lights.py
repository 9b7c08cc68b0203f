"""A light is one module, and is chosen as often as it brings noise."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.reference.integrator import Tracer
from fabricusd.reference.lights.kinds import KINDS
from fabricusd.reference.lights.row import CHANCE, COLUMNS
from fabricusd.reference.lights.table import Lights, share_by_noise
from fabricusd.reference.rays.camera import build_lens
from fabricusd.scene import light_kinds
from fabricusd.scene.light_kinds import DISTANT, RECT
from fabricusd.scene.scene import Light, PreviewSurface, Scene
from tests.reference.scenes import above, grid, looking


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


def _table(chances: list[float]) -> Lights:
    table = np.zeros((len(chances), COLUMNS), np.float32)
    table[:, CHANCE] = chances
    return Lights(table, None)


def test_chances_follow_the_noise_of_each_light():
    # The second light brings as much light as the first, in one of four paths.
    found = np.zeros((3, 50, 8), np.float32)
    found[0] = 1.0
    found[1, :, ::4] = 4.0
    lights = _table([1 / 3] * 3)
    share_by_noise(lights, found)
    first, second, dark = lights.table[:, CHANCE]
    assert (second - 0.2 / 3) / (first - 0.2 / 3) == pytest.approx(2.0, rel=1e-4)
    assert dark == pytest.approx(0.2 / 3, rel=1e-4)
    assert lights.table[:, CHANCE].sum() == pytest.approx(1.0)


def test_a_bright_pixel_does_not_outweigh_the_others():
    found = np.zeros((2, 100, 8), np.float32)
    found[0] = 1.0
    found[1, 7] = 1e4
    lights = _table([0.5, 0.5])
    share_by_noise(lights, found)
    assert lights.table[0, CHANCE] > 0.7


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_chances_stay_where_nothing_is_learnt(value):
    lights = _table([0.3, 0.7])
    share_by_noise(lights, np.full((2, 4, 8), value, np.float32))
    assert lights.table[:, CHANCE].tolist() == pytest.approx([0.3, 0.7])


def test_a_light_behind_a_wall_is_seldom_chosen():
    """Its power would give it nearly all samples; it brings nothing to what the camera sees."""
    floor = grid(size=4.0)
    wall = replace(floor, points=floor.points + np.array([0.0, 3.0, 0.0]))
    lamp = Light(path="hidden", kind=DISTANT, radiance=(100.0,) * 3, frame=looking((0, 5, 0.1)))
    sky = Light(path="sky", kind=RECT, radiance=(5.0,) * 3, frame=looking((1.0, 1.0, 0.0)))
    scene = Scene(
        meshes=[grid(), wall], materials=[PreviewSurface()], lights=[lamp, sky],
        camera=above(height=2.0),
    )  # fmt: skip
    tracer = Tracer(scene)
    lens = build_lens(scene.camera, 32, 32, tracer.tables.centre, "tent")
    tracer.aim(lens, 32, 32)
    assert tracer.lights.table[0, CHANCE] == pytest.approx(0.1, abs=1e-6)
