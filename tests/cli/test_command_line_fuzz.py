"""Command lines that nobody would type: status 0, 1 or 2, one line, and no traceback."""

from __future__ import annotations

import io
import sys
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.cli.main import COMMANDS, INTERNAL, build_parser, main
from tests.fuzz import examples

LAYER = '#usda 1.0\ndef WovenFabric "A"\n{\n    def WovenThread "T"\n    {\n    }\n}\n'
OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"

WORDS = [
    "", " ", "-", "--", "---", "=", "x", ".", "..", "/", "//", "/dev/null", "/dev/zero", "~",
    "nowhere.usda", "nowhere.obj", "nowhere.wif", "nowhere.png", "nowhere/out.usda", "a.usda",
    "a.usda:/A", "a.usda:/", "a.usda:/B", "a.usda:", ":/A", "x.obj", "x.wif", "folder", "out.exr",
    "out.usda", "out.fbx", "velvet", "velvet:/velvet", "velvet:Pile", "plain", "twill 2/2",
    "satin 8 step 3", "mod(i, 2) < 1", "mod(i*j, 0) < 1", "2*#fff", "#12", "1,2,3", "nan,nan,nan",
    "1-10", "1-10x0", "nan", "inf", "-inf", "-1", "0", "1", "16", "1e308", "1e999", "9" * 5000,
    "a" * 300, "a" * 5000, "a\0b", "\ud800", "\udcff.usda", "é", "漢字.usda", "\u2028", "\x1b[31m",
    "a\nb", "a\tb", "%s", "%", "{0}", "$(x)", "*", "[", "none", "auto", "all", "horizon", "😀" * 50,
]  # fmt: skip


def options_of(command: str) -> list[str]:
    parser = build_parser(command)._subparsers._group_actions[0].choices[command]
    return [word for action in parser._actions for word in action.option_strings]


OPTIONS = {command: options_of(command) for command in COMMANDS}

HEAVY = {"--stability", "--choice"}
"""Options that measure for minutes, whatever else is said."""

SAFE = {
    # What is added so that nothing heavy runs, whatever else is said.
    "render": ["--dry-run"],
    "bake": ["--dry-run"],
    "material": ["--dry-run"],
    "new": ["--dry-run"],
    "blender-addon": ["--dry-run"],
    "measure": ["--dry-run"],
    "fit": ["--dry-run"],
    "chart": ["--list-panels"],
    "demo": ["--output", "x.obj/never"],
    "preview": ["--output", "x.obj/never.png"],
}

word = st.sampled_from(WORDS) | st.text(max_size=12) | st.floats().map(str) | st.integers().map(str)


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    command = draw(st.sampled_from([*COMMANDS, *COMMANDS, "nothing"]))
    option = st.sampled_from([o for o in OPTIONS.get(command, ["-x"]) if o not in HEAVY])
    parts: list[str] = []
    for _ in range(draw(st.integers(0, 6))):
        kind = draw(st.integers(0, 5))
        if kind <= 1:
            parts.append(draw(word))
        elif kind <= 3:
            parts += [draw(option), draw(word)]
        elif kind == 4:
            parts.append(f"{draw(option)}={draw(word)}")
        else:
            parts.append(draw(option)[: draw(st.integers(1, 12))])
    if any(part.startswith(("--s", "--ch")) for part in parts) and command == "chart":
        parts = [part for part in parts if not part.startswith(("--s", "--ch"))]
    before = draw(st.sampled_from([[]] * 8 + [[draw(word)]]))
    return [*before, command, *parts, *SAFE.get(command, [])]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("lines")
    (made / "a.usda").write_text(LAYER)
    (made / "x.obj").write_text(OBJ)
    (made / "x.wif").write_text("[WIF]\nVersion=1.1\n")
    (made / "folder").mkdir()
    return made


def called(arguments: list[str]) -> tuple[int, str, str]:
    """(status, stdout, stderr) of `main`, on streams of their own."""
    kept = sys.stdout, sys.stderr
    sys.stdout = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    sys.stderr = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace")
    try:
        try:
            status = main(arguments)
        except SystemExit as stop:
            status = 0 if stop.code is None else stop.code
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        out, err = (s.buffer.getvalue().decode() for s in (sys.stdout, sys.stderr))
    finally:
        sys.stdout, sys.stderr = kept
    return status, out, err


@settings(max_examples=examples(150, 10_000))
@given(command_lines())
def test_any_command_line_ends_in_a_status_and_at_most_one_line(folder, arguments):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        before = sorted(p.name for p in folder.rglob("*"))
        began = time.process_time()
        status, _, err = called(arguments)
        seconds = time.process_time() - began
        assert sorted(p.name for p in folder.rglob("*")) == before
    assert status in (0, 1, 2)
    assert "Traceback" not in err
    assert INTERNAL not in err
    assert seconds < 10
    # `check` says of each file that cannot be read what is wrong.
    if status == 2 and "check" not in arguments:
        assert len(err.splitlines()) == 1
        assert err.startswith("fabricusd")
        assert err.removesuffix("\n").isprintable()


def test_the_fuzzer_would_see_a_traceback(monkeypatch):
    """A command that fails ends in one line that says so, which the test above does not take."""
    import fabricusd.cli.cat as cat

    def broken(options):
        raise KeyError("oops")

    monkeypatch.setattr(cat, "run", broken)
    status, _, err = called(["cat", "velvet"])
    assert status == 2
    assert err == (
        "fabricusd: internal error: KeyError: 'oops'; please report it with the "
        "traceback that FABRICUSD_DEBUG=1 shows\n"
    )
    monkeypatch.setenv("FABRICUSD_DEBUG", "1")
    status, _, err = called(["cat", "velvet"])
    assert status == 2
    assert err.startswith("Traceback")
    assert err.endswith("internal error: KeyError: 'oops'; please report it\n")


def test_debugging_shows_what_a_reader_raised(monkeypatch, tmp_path):
    monkeypatch.setenv("FABRICUSD_DEBUG", "1")
    (tmp_path / "x.usda").write_text("#usda 1.0\ndef {")
    status, _, err = called(["cat", str(tmp_path / "x.usda")])
    assert status == 2
    assert "The above exception was the direct cause" in err
    monkeypatch.setenv("FABRICUSD_DEBUG", "0")
    _, _, err = called(["cat", str(tmp_path / "x.usda")])
    assert len(err.splitlines()) == 1
