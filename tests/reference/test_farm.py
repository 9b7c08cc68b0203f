"""A picture of a cluster is the picture of one machine, to the bit."""

from __future__ import annotations

import contextlib
import random
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.images.files import read_exr_layers
from fabricusd.reference import farm
from fabricusd.reference.film import Film
from fabricusd.reference.passes import Pass, Sampling, passes
from fabricusd.reference.render import render, render_scene
from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.placements import Placements
from fabricusd.scene.scene import FabricSurface, Light, Scene
from fabricusd.scene.staging import Staging
from fabricusd.schema import load
from fabricusd.stop import Stop
from tests.reference.scenes import above, grid
from tests.run.clusters import kill_a_worker


def cloth() -> Scene:
    """A square of linen under a sky and a sun."""
    linen = Binding(fabric=load("linen_plain"), threads_per_uv=(1600.0, 1600.0))
    lights = [
        Light(path="sky", kind=DOME, radiance=(0.4, 0.5, 0.6)),
        Light(path="sun", kind=DISTANT, radiance=(2.0, 1.8, 1.5), angle=0.01),
    ]
    return Scene(
        meshes=[grid()], materials=[FabricSurface(binding=linen)], lights=lights, camera=above()
    )


def instances() -> Scene:
    """The square at three places, one of them mirrored."""
    scene = cloth()
    transforms = np.tile(np.eye(4)[:3], (3, 1, 1))
    transforms[1, 0, 0], transforms[1, 0, 3], transforms[2, 1, 3] = -1, 0.7, -0.5
    placements = Placements(
        transforms=transforms, paths=("/square",), path_of=np.zeros(3, np.int32)
    )
    scene.meshes = [replace(mesh, placements=placements) for mesh in scene.meshes]
    return scene


def same(a: Any, b: Any) -> None:
    assert a.layers.keys() == b.layers.keys()
    for name, layer in a.layers.items():
        np.testing.assert_array_equal(layer, b.layers[name], err_msg=name)


@pytest.mark.parametrize(
    "how",
    [
        # Two rounds of jobs: the last pass has fewer samples.
        {"spp": 40, "aovs": ("beauty", "variance", "normal", "depth")},
        {"spp": 64, "noise": 0.05, "aovs": ("beauty", "variance", "samples")},
    ],
)
def test_the_picture_is_the_same_to_the_bit(cluster, how):
    size = {"width": 48, "height": 40, "level": "far"}
    one = render_scene(cloth(), workers=1, **size, **how)
    many = render_scene(cloth(), cluster=cluster, **size, **how)
    same(one, many)
    assert many.complete
    assert (one.rays, one.not_finite, one.met) == (many.rays, many.not_finite, many.met)
    assert many.cut == pytest.approx(one.cut)


def test_a_picture_of_instances_is_the_same_to_the_bit(cluster):
    settings = {"width": 48, "height": 40, "spp": 20, "aovs": ("beauty", "normal", "uv")}
    one = render_scene(instances(), workers=1, **settings)
    many = render_scene(instances(), cluster=cluster, **settings)
    assert one.metadata["fabricusd:instances"] == 3
    same(one, many)
    assert many.complete


def test_what_ctrl_c_leaves_is_a_picture(cluster):
    stop = Stop()

    def progress(share: float, _: float) -> None:
        stop.asked = share > 0

    found = render_scene(
        cloth(), width=64, height=64, spp=256, level="far", cluster=cluster, stop=stop,
        progress=progress, aovs=("beauty", "samples"),
    )  # fmt: skip
    assert not found.complete
    samples = found.layers["samples"]
    assert 0 < samples.max() < 256
    assert np.isfinite(found.layers["beauty"]).all()


def test_frames_are_jobs_of_their_own(cluster, monkeypatch, tmp_path):
    # The package exports a function by the module's name.
    module = sys.modules["fabricusd.reference.render"]
    monkeypatch.setattr(module, "cluster_or_threads", lambda *_: contextlib.nullcontext(cluster))
    how: Any = {"width": 24, "height": 16, "spp": 4, "level": "far", "staging": Staging(orbit=3)}
    many = render(cloth(), tmp_path / "many.exr", **how)
    monkeypatch.undo()
    one = render(cloth(), tmp_path / "one.exr", workers=1, **how)
    same(one, many)
    assert [Path(p).name for p in many.paths if p.endswith("exr")] == [
        f"many.{k:04d}.exr" for k in (1, 2, 3)
    ]
    for k in (1, 2, 3):
        a, b = (read_exr_layers(tmp_path / f"{name}.{k:04d}.exr")[0] for name in ("one", "many"))
        np.testing.assert_array_equal(a["beauty"], b["beauty"])


def test_progress_ends_at_one(cluster):
    told: list[float] = []
    render_scene(
        cloth(), width=16, height=16, spp=20, level="far", cluster=cluster,
        progress=lambda share, _: told.append(share),
    )  # fmt: skip
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1.0)


def test_render_refuses_a_cluster_with_threads(tmp_path):
    with pytest.raises(FabricError, match="--workers"):
        render(cloth(), tmp_path / "x.exr", width=8, height=8, workers=2, scheduler="local")
    assert not list(tmp_path.iterdir())


def test_pieces_are_whole_batches():
    sampling = Sampling(width=100, height=70, most=64)
    one = next(passes(sampling, Film(100, 70, ("beauty",))))
    for count in (1, 3, 8, 10_000):
        pieces = farm._pieces(one, count)
        assert len(pieces) <= count
        np.testing.assert_array_equal(np.concatenate([p.pixels for p in pieces]), one.pixels)
        batches = [p.batch(k) for p in pieces for k in range(p.batches)]
        assert len(batches) == one.batches
        for k, pixels in enumerate(batches):
            np.testing.assert_array_equal(pixels, one.batch(k))


def test_a_job_holds_no_more_passes_than_memory_allows(monkeypatch):
    film = Film(100, 70, ("beauty",))
    one = Pass(pixels=np.arange(7000, dtype=np.int32), done=0, samples=16, per_batch=64, share=1.0)
    many = Sampling(width=100, height=70, most=4096)
    assert farm._passes_at_once(many, film, one) == farm.MOST_PASSES
    monkeypatch.setattr(farm, "HELD", 3 * 7000 * 48)
    assert farm._passes_at_once(many, film, one) == 3
    monkeypatch.setattr(farm, "HELD", 1)
    assert farm._passes_at_once(many, film, one) == 1
    adaptive = Sampling(width=100, height=70, most=4096, noise=0.1)
    monkeypatch.setattr(farm, "HELD", 1 << 28)
    assert farm._passes_at_once(adaptive, film, one) == 1


@pytest.mark.exhaustive
def test_ten_killed_workers_change_nothing(cluster):
    chance, killed = random.Random(1), 0

    def progress(share: float, _: float) -> None:
        nonlocal killed
        if killed < 10 and share > 0 and chance.random() < 0.6:
            killed += kill_a_worker(cluster)

    how = {"width": 96, "height": 96, "spp": 4096, "level": "far", "aovs": ("beauty", "variance")}
    one = render_scene(cloth(), **how)
    many = render_scene(cloth(), cluster=cluster, progress=progress, **how)
    assert killed == 10
    same(one, many)
