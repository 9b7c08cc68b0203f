"""The guards of the fuzz tests bite."""

from __future__ import annotations

import signal
import sys
import time

import pytest
from hypothesis import given

from fabricusd.errors import FabricError
from tests import fuzz


def busy(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_the_switch_chooses_the_number_of_inputs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("FABRICUSD_FUZZ", raising=False)
    assert fuzz.examples(20, 1000) == 20
    monkeypatch.setenv("FABRICUSD_FUZZ", "long")
    assert fuzz.examples(20, 1000) == 1000


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="there are no interval timers here")
def test_an_input_that_takes_too_long_fails_even_where_its_reader_catches_all() -> None:
    with pytest.raises(fuzz.Hang), fuzz.no_hang(0.05):
        busy(5)

    def deaf() -> None:
        try:
            busy(5)
        except Exception:
            return

    with pytest.raises(fuzz.Hang), fuzz.no_hang(0.05):
        deaf()
    with fuzz.no_hang(0.05):
        time.sleep(0.2)  # time on the clock alone is nobody's fault


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has /proc")
def test_an_input_that_asks_for_too_much_memory_fails_and_the_next_may_have_it() -> None:
    with pytest.raises(MemoryError), fuzz.bounded_memory(100):
        bytearray(200 * 2**20)
    assert len(bytearray(200 * 2**20)) == 200 * 2**20


def refuse(text: str) -> None:
    raise FabricError("it", text)


def test_a_refusal_must_be_one_line_and_anything_else_gets_through() -> None:
    assert fuzz.refusal(refuse, "is bad") == "it is bad"
    assert fuzz.refusal(str, 1) == ""
    with pytest.raises(AssertionError, match="plain line"):
        fuzz.refusal(refuse, "is bad\nand worse")
    with pytest.raises(ZeroDivisionError):
        fuzz.refusal(divmod, 1, 0)


def test_a_child_that_fails_or_dies_is_noticed(capfd: pytest.CaptureFixture[str]) -> None:
    fuzz.in_child(lambda: None)
    with pytest.raises(AssertionError, match="the child failed"):
        fuzz.in_child(lambda: refuse("is bad"))
    assert "is bad" in capfd.readouterr().err
    with pytest.raises(AssertionError, match="signal 9"):
        fuzz.in_child(lambda: signal.raise_signal(signal.SIGKILL))


@given(fuzz.mutated(b"some good bytes of a file"))
def test_damaged_bytes_stay_short(data: bytes) -> None:
    assert len(data) < 1000
