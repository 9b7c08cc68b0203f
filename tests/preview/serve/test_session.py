"""A session: cloth that is open, and the one file that it writes."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.preview.lights import Lights
from fabricusd.preview.page.threads import thread_controls
from fabricusd.preview.serve import session as sessions
from fabricusd.preview.serve.session import Session, require_file
from fabricusd.schema.check import check
from fabricusd.schema.read import load
from fabricusd.schema.write import save


def answered(session: Session, path: str, **said):
    return session.answer(path, json.dumps(said).encode())


def test_a_variant_is_saved_that_check_passes(tmp_path):
    file = tmp_path / "look.usda"
    session = Session(Fabric(), lights=Lights(), save=file)
    numbers = [thread["values"] for thread in thread_controls(Fabric())]
    numbers[0][0] = 0.55
    names = [control["name"] for control in thread_controls(Fabric())[0]["controls"]]
    for name, value in (("angle 1", 30.0), ("cv", 12.0), ("plies", 2)):
        numbers[0][names.index(name)] = value
    said = answered(
        session, "/save", variant="claret", threads=numbers, weave="10/11", coverage=[0.25, 0.5],
        density=[-1, 24.0],
    )  # fmt: skip
    assert said["file"] == "look.usda"
    answered(session, "/save", variant="plain")
    assert check(file) == []
    claret = load(f"{file}{{fabricVariant=claret}}")
    assert claret.threads["Thread"].albedo == (0.55, 0.2, 0.2)
    thread = claret.threads["Thread"]
    assert thread.curve.angles == pytest.approx((0.0, math.radians(30)))
    yarn = thread.unevenness_cv, thread.unevenness_length, thread.plies
    assert yarn == pytest.approx((0.12, 0.01, 2))
    assert claret.weft.density == pytest.approx(2400)
    assert claret.warp == replace(Fabric().warp, coverage=0.25)
    assert claret.weave.cells.tolist() == [[True, True], [False, True]]
    assert (claret.warp.coverage, claret.weft.coverage) == (0.25, 0.5)
    for other in ("plain", "original"):
        found = load(f"{file}{{fabricVariant={other}}}")
        assert (found.threads, found.weave.cells.tolist()) == (
            Fabric().threads, Fabric().weave.cells.tolist(),
        )  # fmt: skip


def test_the_file_that_is_served_gets_the_variant_and_keeps_the_rest(tmp_path):
    file = tmp_path / "mine.usda"
    save(Fabric(name="Mine", documentation="kept"), file)
    session = Session(load(file), lights=Lights(), save=file)
    answered(session, "/save", variant="thin", coverage=[0.125, 0.125])
    assert load(file).documentation == "kept"
    assert load(file).warp.coverage == 0.125
    assert load(f"{file}{{fabricVariant=original}}").warp.coverage is None


def test_cloth_of_another_file_does_not_go_into_this_one(tmp_path):
    file = tmp_path / "mine.usda"
    session = Session(Fabric(), lights=Lights(), save=file)
    session.cloths[1] = Fabric(name="Other")
    answered(session, "/save", variant="a", cloth=1)
    with pytest.raises(FabricError, match="holds another cloth"):
        answered(session, "/save", variant="b", cloth=0)


def test_without_a_file_nothing_is_saved():
    with pytest.raises(FabricError, match="start with --save FILE"):
        answered(Session(Fabric(), lights=Lights()), "/save", variant="a")


@pytest.mark.parametrize("name", ["", "a b", "../x", "x" * 81, "a=b=c", "="])
def test_a_variant_needs_a_name(tmp_path, name):
    session = Session(Fabric(), lights=Lights(), save=tmp_path / "a.usda")
    with pytest.raises(FabricError, match="is not a name"):
        answered(session, "/save", variant=name)
    assert list(tmp_path.iterdir()) == []


def test_a_cloth_that_has_faults_is_not_saved(tmp_path, monkeypatch):
    file = tmp_path / "a.usda"
    session = Session(Fabric(), lights=Lights(), save=file)
    other = Fabric(threads={"A": Fabric().threads["Thread"], "B": Fabric().threads["Thread"]})
    monkeypatch.setattr(session, "_cloth", lambda said: other)
    with pytest.raises(FabricError, match="has 1 threads; it must have 2"):
        answered(session, "/save", variant="a")
    assert list(tmp_path.iterdir()) == []


def test_only_so_many_cloths_are_held(monkeypatch):
    monkeypatch.setattr(sessions, "MOST_OPEN", 3)
    monkeypatch.setattr(sessions, "page_data", lambda *_: {})
    monkeypatch.setattr(sessions, "opened", lambda *_: (Fabric(), ()))
    session = Session(Fabric(), lights=Lights())
    for number in range(1, 6):
        assert answered(session, "/open", name="a.wif", data="")["cloth"] == number
    assert sorted(session.cloths) == [0, 4, 5]
    with pytest.raises(FabricError, match="cloth 1 is no longer open"):
        answered(session, "/fabric", cloth=1)


def test_a_file_that_is_not_the_one_served_is_refused_at_once(tmp_path):
    file, other = tmp_path / "a.usda", tmp_path / "b.usda"
    save(Fabric(), file)
    save(Fabric(), other)
    require_file(tmp_path / "new.usda", str(other), False)
    require_file(file, str(file), False)
    for path, source, scene, said in (
        (file, str(other), False, "exists and is not"), (file, "denim", False, "exists and is not"),
        (file, str(file), True, "must be a new name where a scene is served"),
        (tmp_path / "a.txt", "denim", False, "must end in .usda"),
        (tmp_path / "no" / "a.usda", "denim", False, "is not a directory"),
    ):  # fmt: skip
        with pytest.raises(FabricError, match=said):
            require_file(path, source, scene)
