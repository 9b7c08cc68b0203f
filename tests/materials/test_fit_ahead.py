"""Fits of a look on a cluster: those of this machine, which then has nothing to fit."""

from __future__ import annotations

import pytest
from materials.scenes import bake_shirt

from fabricusd import cache
from fabricusd.materials import fit_ahead as module
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.fit.texels import draw_texels
from fabricusd.materials.fit_ahead import Lobes, Surfaces, fit_ahead
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings


@pytest.fixture(scope="module")
def shirt(tmp_path_factory):
    return bake_shirt(tmp_path_factory.mktemp("shirt"))[1]


@pytest.fixture
def jobs(shirt):
    maps = read_bake_folder(shirt).garments[0]
    lay = maps.lays[0]
    texels = draw_texels(maps, 0, lay)
    return [Surfaces(texels, lay.fabric, ("preview",)), Lobes(lay.fabric, 1, None, False)]


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A cache of this process alone, which knows no fits."""
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "cache"))


def entries_of(jobs):
    with cache.recorded(*module.KINDS) as found:
        for job in jobs:
            job.fit()
    return {(kind, name): array.tobytes() for kind, name, array in found}


@pytest.mark.exhaustive
def test_the_fits_of_the_cluster_are_those_of_this_process(cluster, jobs, elsewhere, monkeypatch):
    said: list[str] = []
    fit_ahead(jobs, cluster, said.append)
    assert said == ["fitting on the cluster: 2 jobs"]
    with cache.only_known(*module.KINDS):
        for job in jobs:
            job.fit()
    theirs = entries_of(jobs)
    monkeypatch.setenv(cache.VARIABLE, str(cache.root().with_name("third")))
    assert entries_of(jobs) == theirs
    assert len(theirs) >= 3


@pytest.mark.exhaustive
def test_what_is_known_is_not_fitted_again(cluster, jobs, elsewhere, monkeypatch):
    for job in jobs:
        job.fit()
    monkeypatch.setattr(module, "spread", lambda *_: pytest.fail("nothing is left to fit"))
    fit_ahead(jobs, cluster, pytest.fail)


@pytest.mark.exhaustive
def test_the_look_is_the_same_to_the_bit(cluster, shirt, tmp_path, monkeypatch):
    settings = Settings(surfaces=("openpbr", "lobes"), lobes=1)
    looks = []
    for name, scheduler in (("here", None), ("there", cluster)):
        monkeypatch.setenv(cache.VARIABLE, str(tmp_path / f"{name}.cache"))
        folder = tmp_path / name
        folder.mkdir()
        write_materials(shirt, folder / "look.usda", settings, scheduler=scheduler)
        looks.append({p.name: p.read_bytes() for p in folder.rglob("*") if p.is_file()})
    assert looks[0].keys() == looks[1].keys()
    assert [name for name in looks[0] if looks[0][name] != looks[1][name]] == []
