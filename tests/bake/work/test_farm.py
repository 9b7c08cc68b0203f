"""Textures of a cluster are the textures of one machine, to the bit, and can be resumed."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path

import pytest

from fabricusd.bake import bake as module
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.fabric import Binding
from fabricusd.schema import load
from tests.bake.meshes import write_quad

SMALL = Settings(
    resolution=512, maps=("base_color", "normal", "thread_id", "height"), file_format="png"
)


def sums(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.glob("[!.]*.png")}


@pytest.fixture(autouse=True)
def this_cluster(cluster, monkeypatch):
    """`scheduler="here"` is the cluster of the tests."""
    real = module.cluster_or_threads
    monkeypatch.setattr(
        module, "cluster_or_threads",
        lambda scheduler, workers: (
            contextlib.nullcontext(cluster) if scheduler == "here" else real(scheduler, workers)
        ),
    )  # fmt: skip


@pytest.mark.parametrize(
    "threads",
    [
        pytest.param((24.0, 24.0), id="table"),
        pytest.param((30.7, 22.1), id="no table", marks=pytest.mark.exhaustive),
    ],
)
def test_textures_are_the_same_to_the_bit(tmp_path, threads):
    scene = write_quad(tmp_path / "square.obj")
    linen = Binding(fabric=load("linen_plain"), threads_per_uv=threads)
    one = bake(scene, tmp_path / "one", SMALL, fabric=linen)
    told: list[tuple[str, int, int]] = []
    many = bake(
        scene, tmp_path / "many", SMALL, fabric=linen, scheduler="here",
        progress=lambda *row: told.append(row),
    )  # fmt: skip
    assert one.finished
    assert many.finished
    assert sums(tmp_path / "one") == sums(tmp_path / "many")
    assert len(sums(tmp_path / "one")) >= 4
    assert ("blocks", 4, 4) in told


def test_a_stopped_bake_is_resumed_on_the_cluster(tmp_path, cluster, monkeypatch):
    scene = write_quad(tmp_path / "square.obj")
    linen = Binding(fabric=load("linen_plain"), threads_per_uv=(24.0, 24.0))
    bake(scene, tmp_path / "whole", SMALL, fabric=linen)
    with monkeypatch.context() as patch:
        patch.setattr(module, "assemble", lambda _: False)
        stopped = bake(scene, tmp_path / "out", SMALL, fabric=linen, scheduler="here")
    assert not stopped.finished
    asked: list[int] = []
    real = cluster.run
    monkeypatch.setattr(
        cluster, "run", lambda f, shared, jobs, *rest: asked.append(len(jobs)) or real(
            f, shared, jobs, *rest
        ),
    )  # fmt: skip
    bake(scene, tmp_path / "out", SMALL, fabric=linen, scheduler="here", resume=True)
    assert asked == [0]
    assert sums(tmp_path / "whole") == sums(tmp_path / "out")
