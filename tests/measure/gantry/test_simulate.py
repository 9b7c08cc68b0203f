"""The simulated gantry: repeatable, honest about its noise, and never over another folder."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.measure import DESIGNS, simulate
from fabricusd.measure.capture.manifest import read_manifest
from fabricusd.measure.gantry.camera import Camera, mosaicked
from fabricusd.measure.gantry.scenes import thread_radiance
from fabricusd.measure.gantry.simulate import Shoot
from tests.measure.shoots import SPUN, shot

SMALL = Shoot(design="coarse", shape=(8, 24), times=(0.02, 0.8))


def digest(folder: Path) -> str:
    found = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()


def test_equal_seeds_give_equal_folders_however_many_workers(tmp_path):
    made = {}
    for name, seed, workers in (("a", 1, 1), ("b", 1, 3), ("c", 2, 1)):
        simulate(SPUN, tmp_path / name, shoot=SMALL, seed=seed, workers=workers)
        made[name] = digest(tmp_path / name)
    assert made["a"] == made["b"]
    assert made["a"] != made["c"]


def test_a_folder_that_holds_something_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(FabricError, match=r"holds 'mine.txt'; it must be a new or an empty folder"):
        simulate(SPUN, tmp_path, shoot=SMALL)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]


def test_an_unknown_design_is_refused(tmp_path):
    with pytest.raises(FabricError, match="is 'all'; it must be one of incidence, slice, half"):
        simulate(SPUN, tmp_path / "a", shoot=replace(SMALL, design="all"))
    assert not (tmp_path / "a").exists()


def test_a_thread_s_image_has_the_radiance_it_is_asked_for_per_width_and_row():
    value = np.array([0.2, 0.5, 1.0])
    for defocus in (0.0, 3.0):
        colour = thread_radiance(value, (48, 96), 5.0, defocus, 0.3, np.random.default_rng(0))
        np.testing.assert_allclose(colour.sum(axis=(0, 1)) / (48 * 5.0), value, rtol=2e-3)


def test_noise_has_the_deviation_of_shot_and_read_noise():
    camera = Camera(bits=16)
    even = np.full((400, 400), 0.05)
    codes = camera.expose(even, 0.8, np.random.default_rng(0)).astype(float)
    electrons = even[0, 0] * camera.gain * 0.8 + camera.dark * 0.8
    wanted = np.hypot(np.sqrt(electrons), camera.read) / camera.full * camera.levels
    np.testing.assert_allclose(codes.std(), wanted, rtol=0.01)


def test_the_mosaic_takes_each_colour_from_its_site():
    colour = np.zeros((4, 6, 3))
    colour[:] = (1.0, 2.0, 3.0)
    np.testing.assert_array_equal(mosaicked(colour)[:2, :2], [[1, 2], [2, 3]])


def test_the_manifest_describes_every_frame():
    manifest = read_manifest(shot())
    assert manifest.notes == ()
    assert len(manifest.views()) == len(DESIGNS["coarse"]()[0])
    assert len(manifest.shots) == len(list(shot().glob("*.pgm")))
    assert {s.kind for s in manifest.shots} == {"chart", "dark", "white", "focused", "slice"}


def test_the_half_sphere_has_the_thesis_s_number_of_captures():
    views = len(DESIGNS["half"]()[0])
    assert 50_000 < views * 4 * 2 < 55_000
