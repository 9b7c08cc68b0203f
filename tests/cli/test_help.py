"""Help, slips and completion: what a person meets before anything works."""

from __future__ import annotations

import subprocess
import sys

import pytest

from fabricusd.cli.main import COMMANDS, build_parser
from fabricusd.errors import did_you_mean
from tests.cli.commands import run

ONE_OF_THEM = {"--preset", "--from", "--wif", "--image", "--figure"}
"""Sources of `new`, of which one is needed: none of them has a default."""


def options_of(command):
    parser = build_parser(command)._subparsers._group_actions[0].choices[command]
    return [action for action in parser._actions if action.option_strings]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_says_what_it_does_and_what_holds_without_it(command):
    for action in options_of(command):
        name = action.option_strings[-1]
        assert action.help, name
        takes_a_value = action.nargs != 0 and not action.required
        if takes_a_value and name not in ONE_OF_THEM:
            assert "default" in action.help or action.help.startswith("also "), name


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command_is_that_command_s_help(command, capsys):
    status, out, _ = run(capsys, "help", command)
    assert (status, out) == run(capsys, command, "--help")[:2]


def test_help_alone_lists_the_commands(capsys):
    status, out, _ = run(capsys, "help")
    assert status == 0
    assert all(command in out for command in COMMANDS)
    assert "fabricusd help COMMAND" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("rendr",), "did you mean 'render'?"),
        (("help", "chek"), "did you mean 'check'?"),
        (("cat", "velvet", "--jsn"), "unrecognized arguments: --jsn (did you mean '--json'?)"),
        (("new", "--weave", "plain", "--thikness=2"), "(did you mean '--thickness'?)"),
        (("cat", "velvt"), "(did you mean 'velvet'?)"),
        (("new", "--preset", "Linen_Plane"), "(did you mean 'linen_plain'?)"),
        (("new", "--weave", "twil 2/2"), "(did you mean 'twill'?)"),
        (("new", "--weave", "plain", "--thread", "silk_shot:Grean"), "(did you mean 'Green'?)"),
        (("render", "x", "-o", "x.png", "--level", "wave"), "(did you mean 'weave'?)"),
    ],
)
def test_a_slip_is_refused_with_what_was_meant(arguments, said, capsys):
    status, _, err = run(capsys, *arguments)
    assert status == 2
    assert said in err
    assert len(err.splitlines()) == 1


def test_an_attribute_that_the_schema_lacks_is_found_with_the_one_meant(capsys, tmp_path):
    layer = tmp_path / "a.usda"
    run(capsys, "new", "--weave", "plain", "-o", str(layer))
    layer.write_text(layer.read_text().replace("thread:gammaSurface", "thread:gamaSurface"))
    _, out, _ = run(capsys, "check", str(layer))
    assert "is not in the schema of WovenThread (did you mean 'thread:gammaSurface'?)" in out


def test_nothing_is_meant_by_a_word_that_is_far_from_all():
    assert did_you_mean("zzz", ["plain", "twill"]) == ""
    assert did_you_mean("PLAIN", ["plain", "twill"]) == " (did you mean 'plain'?)"


def completed(words: list[str], script: str) -> set[str]:
    """What bash offers for the last of `words`."""
    lines = f"{script}\nCOMP_WORDS=({' '.join(words)})\nCOMP_CWORD={len(words) - 1}\n"
    lines += "_shtab_fabricusd\nprintf '%s\\n' \"${COMPREPLY[@]}\""
    made = subprocess.run(["bash", "-c", lines], capture_output=True, text=True, check=True)
    return {line.strip() for line in made.stdout.splitlines()}


def test_bash_completes_commands_options_and_presets(capsys):
    pytest.importorskip("shtab")
    status, script, _ = run(capsys, "--print-completion", "bash")
    assert status == 0
    assert completed(["fabricusd", "re"], script) == {"render"}
    assert "--view" in completed(["fabricusd", "render", "--vi"], script)
    assert completed(["fabricusd", "new", "--preset", "vel"], script) == {"velvet"}
    assert completed(["fabricusd", "render", "--level", "w"], script) == {"weave"}


def test_completion_without_shtab_says_what_to_install(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "shtab", None)
    status, _, err = run(capsys, "--print-completion", "bash")
    assert status == 2
    assert err == "fabricusd: --print-completion needs shtab; install it with: pip install shtab\n"


def test_a_shell_that_is_not_known_is_refused(capsys):
    status, _, err = run(capsys, "--print-completion", "bahs")
    assert status == 2
    assert "(did you mean 'bash'?)" in err


def test_the_demo_prints_about_twenty_lines_and_what_to_open(capsys, tmp_path):
    status, out, _ = run(capsys, "demo", "-o", str(tmp_path / "demo"))
    assert status == 0
    assert len(out.splitlines()) <= 24
    assert f"fabricusd cat {tmp_path / 'demo' / 'silk_shot.usda'}" in out.splitlines()[-3]
    assert (tmp_path / "demo" / "silk_shot.wif").exists()
