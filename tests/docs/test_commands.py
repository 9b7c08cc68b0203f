"""Commands on the pages are ones that the programs take."""

from __future__ import annotations

import re
import shlex

import pytest

from fabricusd.cli.main import COMMANDS, build_parser
from tests.docs.pages import PAGES, ROOT, commands, lines_of_code, mentioned


def words_of(line: str) -> list[str]:
    """The words of a command line, without the shell's redirections and comments."""
    words = shlex.split(line, comments=True)[1:]
    end = next((k for k, word in enumerate(words) if word in (">", "|", "&&", ";")), len(words))
    return words[:end]


def fault_of(line: str, capsys: pytest.CaptureFixture[str]) -> str:
    """What the parser says against a command line; nothing if it takes it."""
    words = words_of(line)
    if words[:1] == ["help"] or any(word.startswith("--print-completion") for word in words):
        return "" if words[0] != "help" or words[1] in COMMANDS else "no such command"
    try:
        build_parser(words[0]).parse_args(words)
    except SystemExit as ended:
        said = capsys.readouterr().err
        return said if ended.code else ""
    return ""


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)])
def test_the_parser_takes_every_command_of_a_page(page, capsys):
    assert {line: fault_of(line, capsys) for line in commands(page) if fault_of(line, capsys)} == {}


def test_a_slip_on_a_page_is_found(capsys):
    assert "--framerate" in fault_of("fabricusd render a.usda b.png --framerate 3", capsys)
    assert fault_of("fabricusd rendr a.usda b.png", capsys)
    assert fault_of("fabricusd render a.usda --spp many", capsys)


def options_of(command: str) -> set[str]:
    """The options of a command."""
    parser = build_parser(command)._subparsers._group_actions[0].choices[command]
    return {name for action in parser._actions for name in action.option_strings}


@pytest.mark.parametrize("page", [page for page in PAGES if mentioned(page)])
def test_commands_and_options_named_in_the_text_exist(page):
    for line in mentioned(page):
        command, *others = line.split()[1:]
        if command in ("help", "X", "COMMAND", "NAME") or command.startswith("-"):
            continue
        assert command in COMMANDS, line
        given = {re.sub(r"[^\w-].*", "", word) for word in others if word.startswith("-")}
        assert given <= options_of(command), line


@pytest.mark.parametrize("page", PAGES)
def test_scripts_that_a_page_runs_are_there(page):
    named = " ".join(lines_of_code(page))
    text = (ROOT / page).read_text("utf-8")
    found = set(re.findall(r"python ((?:docs|bench|samples)/[\w/]+\.py)", named + text))
    assert {path for path in found if not (ROOT / path).is_file()} == set()


@pytest.mark.parametrize("page", PAGES)
def test_targets_that_a_page_makes_are_in_the_makefile(page):
    rules = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    text = (ROOT / page).read_text("utf-8")
    assert set(re.findall(r"`make ([a-z-]+)`", text)) <= rules
