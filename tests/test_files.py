"""Files that appear whole, and what they may stand in place of."""

from __future__ import annotations

import os

import pytest

from fabricusd.errors import FabricError
from fabricusd.files import whole_file


def write(path, text="new"):
    with whole_file(path) as temporary:
        temporary.write_text(text)


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "v1.usda", tmp_path / "latest.usda"
    target.write_text("old")
    link.symlink_to(target)
    write(link)
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["latest.usda", "there", "v1.usda"]


def test_a_link_to_nothing_yet_gets_its_file(tmp_path):
    (tmp_path / "latest.usda").symlink_to(tmp_path / "v2.usda")
    write(tmp_path / "latest.usda")
    assert (tmp_path / "v2.usda").read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
def test_a_pipe_is_refused_and_stays_one(tmp_path):
    pipe = tmp_path / "pipe.usda"
    os.mkfifo(pipe)
    with pytest.raises(FabricError, match="is a pipe or a device; it must be a file's name"):
        write(pipe)
    assert pipe.is_fifo()


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "a.usda"
    target.write_text("old")

    def half(temporary):
        temporary.write_text("half")
        raise RuntimeError

    with pytest.raises(RuntimeError), whole_file(target) as temporary:
        half(temporary)
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.usda"]
