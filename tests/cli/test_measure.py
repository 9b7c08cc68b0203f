"""`measure` and `fit`: photographs become a thread; nothing is written where something is wrong."""

from __future__ import annotations

import json

import pytest

from fabricusd.measure import write_lobes
from fabricusd.schema import load
from tests.cli.commands import run
from tests.measure.shoots import SPUN, lobes_of, shot, spoilt


def test_photographs_become_lobes_and_a_thread_that_other_commands_read(tmp_path, capsys):
    thread, lobes, report = (tmp_path / name for name in ("t.usda", "l.csv", "r.json"))
    status, out, err = run(
        capsys, "measure", str(shot()), "-o", str(thread), "--lobes", str(lobes), "--report",
        str(report),
    )  # fmt: skip
    assert status == 0
    assert out.startswith("microcylinder: chi2/n ")
    assert "words: back surface " in out
    assert "464 frames; " in err
    found = load(thread).thread_list[0]
    assert found.ior == pytest.approx(SPUN.ior, abs=0.01)
    assert found.gamma_surface == pytest.approx(SPUN.gamma_surface, rel=0.03)
    assert found.albedo == pytest.approx(SPUN.albedo, rel=0.03)
    assert "Fitted by fabricusd to " in found.documentation
    assert "chi2/n" in found.documentation
    assert run(capsys, "check", str(thread))[0] == 0
    assert run(capsys, "new", "--weave", "plain", "--thread", str(thread), "-n")[0] == 0
    (fit,) = json.loads(report.read_text())["fits"]
    assert fit["model"] == "microcylinder"

    status, again, _ = run(capsys, "fit", str(lobes), "-o", str(tmp_path / "u.usda"))
    assert status == 0
    assert again == out


def test_a_simulated_gantry_is_measured_in_a_second_command(tmp_path, capsys):
    folder = str(tmp_path / "shoot")
    status, _, err = run(
        capsys, "measure", "--simulate", folder, "--thread", "thread_wool_spun", "--bits", "8",
        "--design", "coarse", "--seed", "5",
    )  # fmt: skip
    assert status == 0
    assert err == f"fabricusd: wrote 464 frames to {folder}\n"
    status, out, _ = run(capsys, "measure", folder, "-n")
    assert (status, out) == (0, "464 frames, 44 views\n")
    status, _, err = run(capsys, "measure", "--simulate", folder)
    assert status == 2
    assert "it must be a new or an empty folder" in err


def test_lobes_alone_are_not_fitted(tmp_path, capsys):
    status, out, _ = run(capsys, "measure", str(shot()), "--lobes", str(tmp_path / "l.npz"), "-q")
    assert (status, out) == (0, "")
    assert (tmp_path / "l.npz").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("measure",), "DIR is missing; name a folder of photographs, or use --simulate"),
        (("measure", "{shot}"), "-o is missing; give -o for the thread, --lobes for the lobes"),
        (("measure", "{shot}", "-o", "t.png"), "t.png has another suffix than .usda"),
        (("measure", "{shot}", "--lobes", "l.txt"), "l.txt is not a table of lobes"),
        (("measure", "{shot}", "--lobes", "no/l.csv"), "which is not a directory"),
        (("measure", "{shot}", "--lobes", "l.csv", "--plots", "p"), "--plots needs a fit"),
        (("measure", "{shot}", "--lobes", "l.csv", "--bits", "8"), "--bits can only be used with"),
        (("measure", "nowhere", "-o", "t.usda"), "manifest.json does not exist"),
        (("measure", "{shot}", "--simulate", "s"), "DIR cannot be used with --simulate"),
        (("measure", "--simulate", "s", "--scheduler", "local"), "--scheduler cannot be used with"),
        (("measure", "{shot}", "--lobes", "l.csv", "--scheduler", "local"), "needs a fit"),
        (("measure", "--simulate", "s", "--thread", "velvt"), "did you mean 'velvet'?"),
        (("measure", "--simulate", "no/s"), "which is not a directory"),
        (("fit", "nowhere.csv", "-o", "t.usda"), "cannot be read: No such file"),
        (("fit", "{one}", "-o", "t.usda", "--gain", "free"), "one incidence, 15 degrees"),
        (("fit", "{one}", "--plots", "here.txt"), "is a file; it must be a folder"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_writes_nothing(
    arguments, said, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    write_lobes(lobes_of(SPUN, "incidence"), "one.csv")
    (tmp_path / "here.txt").write_text("")
    before = sorted(p.name for p in tmp_path.rglob("*"))
    given = [a.format(shot=shot(), one="one.csv") for a in arguments]
    status, out, err = run(capsys, *given)
    assert (status, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert sorted(p.name for p in tmp_path.rglob("*")) == before


def test_an_old_table_is_kept_where_asked_and_a_dry_run_writes_none(tmp_path, capsys):
    table = tmp_path / "l.csv"
    write_lobes(lobes_of(SPUN), table)
    old = table.read_bytes()
    status, _, err = run(capsys, "measure", str(shot()), "--lobes", str(table), "--no-clobber")
    assert status == 2
    assert "exists; it must be a new name" in err
    assert table.read_bytes() == old
    status, out, _ = run(capsys, "fit", str(table), "-n", "-o", str(tmp_path / "t.usda"))
    assert status == 0
    assert out == "182 views, absolute, at incidences 0, 15, 30, 45, 60 degrees\n"
    assert not (tmp_path / "t.usda").exists()


def test_what_is_left_out_of_a_folder_is_told(tmp_path, capsys):
    def change(manifest):
        for one in manifest["shots"]:
            if one["file"] == "view_00000_01_1.pgm":
                del one["exposure"]

    folder = spoilt(tmp_path, change)
    status, _, err = run(capsys, "measure", str(folder), "--lobes", str(tmp_path / "l.csv"))
    assert status == 0
    assert "view_00000_01_1.pgm: there is no exposure from 0 to 3600; left out" in err
    assert (tmp_path / "l.csv").read_text().count("left out") == 1
