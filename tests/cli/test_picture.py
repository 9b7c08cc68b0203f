"""`--picture` of `new`, `set` and `cat`."""

from __future__ import annotations

import pytest

from fabricusd.cli.arguments import picture
from tests.cli.commands import run


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(picture, "SIZE", 16)


def size_of(path) -> tuple[int, int]:
    head = path.read_bytes()
    assert head.startswith(b"\x89PNG")
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def test_new_set_and_cat_leave_a_picture(capsys, tmp_path):
    file = str(tmp_path / "a.usda")
    shown = [tmp_path / f"{name}.png" for name in ("new", "set", "cat")]
    new = ["new", "--preset", "linen_plain", "-o", file, "--picture", str(shown[0])]
    assert run(capsys, *new)[0] == 0
    change = ["set", file, "albedo=0.9,0.05,0.05", "--picture", str(shown[1])]
    assert run(capsys, *change)[0] == 0
    status, printed, _ = run(capsys, "cat", file, "--json", "--picture", str(shown[2]))
    assert status == 0
    assert printed.startswith("{")
    assert [size_of(path) for path in shown] == [(16, 16)] * 3
    first, second, third = (path.read_bytes() for path in shown)
    assert first != second == third


def test_a_dry_run_leaves_none(capsys, tmp_path):
    file, out = tmp_path / "a.usda", tmp_path / "a.png"
    assert (
        run(capsys, "new", "--preset", "denim", "-o", str(file), "--picture", str(out), "-n")[0]
        == 0
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["cat", "denim", "--picture", "a.jpg"], "it must end in .png"),
        (["cat", "denim", "--picture", "no/a.png"], "is not a directory"),
        (["cat", "denim", "--flatten", "--picture", "a.png"], "give it without --flatten"),
        (["new", "--preset", "denim", "-o", "a.usda", "--picture", "a.gif"], "must end in .png"),
    ],
)
def test_a_picture_that_cannot_be_is_refused_before_anything_is_written(
    arguments, said, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    status, printed, err = run(capsys, *arguments)
    assert (status, printed) == (2, "")
    assert said in err
    assert list(tmp_path.iterdir()) == []


def test_a_thread_is_neither_set_nor_shown(capsys, tmp_path):
    file, out = tmp_path / "a.usda", tmp_path / "a.png"
    run(capsys, "new", "--preset", "linen_plain", "-o", str(file))
    before = file.read_bytes()
    thread = next(
        line.split('"')[1] for line in file.read_text().splitlines() if "def WovenThread" in line
    )
    where = f"{file}:/linen_plain/{thread}"
    status, _, err = run(capsys, "set", where, "ior=1.4", "--picture", str(out))
    assert status == 2
    assert "WovenFabric" in err
    assert file.read_bytes() == before
    assert not out.exists()
