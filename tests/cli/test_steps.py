"""The bars of long steps: by name, on a terminal only, and not for steps that are soon over."""

from __future__ import annotations

import io
import sys
import time

import pytest

from fabricusd.cli.terminal import steps
from fabricusd.steps import current, parts


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def put_before(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """A terminal in place of standard error; a fixture's would be replaced before the test."""
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    return screen


def last(seconds: float) -> None:
    for _ in parts("horizon table of 'damask'", range(4)):
        time.sleep(seconds / 4)


def test_a_step_that_lasts_has_a_bar_with_its_name_which_goes_away(monkeypatch):
    terminal = put_before(monkeypatch)
    monkeypatch.setattr(steps, "DELAY", 0.1)
    with steps.shown(quiet=False):
        last(0.6)
    assert "horizon table of 'damask':  75 %" in terminal.getvalue()
    assert terminal.getvalue().rstrip(" ").endswith("\r")


def test_a_step_that_is_soon_over_is_not_shown(monkeypatch):
    terminal = put_before(monkeypatch)
    with steps.shown(quiet=False):
        last(0.2)
    assert "damask" not in terminal.getvalue()


def test_nothing_is_shown_of_a_quiet_command_or_without_a_terminal(monkeypatch):
    terminal = put_before(monkeypatch)
    monkeypatch.setattr(steps, "DELAY", 0.0)
    with steps.shown(quiet=True):
        assert current().listener is None
        last(0.2)
    monkeypatch.setattr(sys, "stderr", other := io.StringIO())
    with steps.shown(quiet=False):
        last(0.2)
    assert (terminal.getvalue(), other.getvalue()) == ("", "")


def test_the_bar_of_a_step_that_is_broken_off_goes_away(monkeypatch):
    terminal = put_before(monkeypatch)
    monkeypatch.setattr(steps, "DELAY", 0.0)

    def interrupted() -> None:
        with steps.shown(quiet=False):
            for k in parts("a step", range(4)):
                time.sleep(0.15)
                if k == 2:
                    raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert "a step" in terminal.getvalue()
    assert terminal.getvalue().rstrip(" ").endswith("\r")
