"""Ctrl-C, SIGTERM and SIGHUP, once and often: what is done is kept, and files are whole."""

from __future__ import annotations

import signal

import pytest

from fabricusd.images.files import read_exr_layers
from fabricusd.reference import picture_files
from fabricusd.reference.render import render
from fabricusd.scene.scene import Scene
from fabricusd.stop import SIGNALS, Stop
from tests.reference.scenes import grid, lambert
from tests.reference.stages import new_stage, square


@pytest.fixture(autouse=True)
def handlers_of_a_terminal():
    """What runs in the background of a script is started with Ctrl-C ignored."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in SIGNALS[1:]:
        signal.signal(number, signal.SIG_DFL)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_raises_until_it_is_held_and_is_remembered_then(number):
    with Stop() as stop:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        with pytest.raises(KeyboardInterrupt):
            stop.hold()
        signal.raise_signal(number)
        signal.raise_signal(number)
        assert stop.asked
        stop.release()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)


def test_handlers_are_given_back_and_those_of_others_left_alone():
    def other(number, frame):
        heard.append(number)

    heard: list[int] = []
    before = signal.getsignal(signal.SIGINT)
    kept = signal.signal(signal.SIGTERM, other)
    try:
        with Stop() as stop:
            assert signal.getsignal(signal.SIGINT) != before
            signal.raise_signal(signal.SIGTERM)
            assert not stop.asked
        assert heard == [signal.SIGTERM]
        assert signal.getsignal(signal.SIGINT) == before
    finally:
        signal.signal(signal.SIGTERM, kept)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_picture_is_kept_however_often_it_is_interrupted(tmp_path, number):
    def impatient(share, seconds):
        signal.raise_signal(number)
        signal.raise_signal(number)

    scene = Scene(meshes=[grid()], materials=[lambert(0.5)])
    out = tmp_path / "x.exr"
    r = render(scene, out, width=64, height=64, spp=4096, progress=impatient, aovs=("samples",))
    assert not r.complete
    assert 0 < r.samples < 4096
    assert read_exr_layers(out)[1]["fabricusd:complete"] == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.exr", "x.png"]


def test_an_interrupt_in_a_frames_last_moments_leaves_out_the_next_ones(tmp_path, monkeypatch):
    stage = new_stage(tmp_path)
    square(stage)
    stage.GetRootLayer().Save()
    write = picture_files.write_png

    def interrupted(*given, **named):
        signal.raise_signal(signal.SIGINT)
        write(*given, **named)

    monkeypatch.setattr(picture_files, "write_png", interrupted)
    r = render(
        tmp_path / "scene.usda", tmp_path / "x.exr", width=8, height=8, spp=1, frames=(1, 2, 3)
    )
    assert not r.complete
    assert [p.rsplit("/", 1)[1] for p in r.paths] == ["x.0001.exr", "x.0001.png"]


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has no SIGHUP")
def test_a_hangup_that_is_ignored_stays_ignored_as_under_nohup():
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with Stop() as stop:
        signal.raise_signal(signal.SIGHUP)
        assert not stop.asked
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN


def test_of_two_the_inner_one_hears_and_the_outer_one_is_given_back():
    with Stop() as outer:
        handler = signal.getsignal(signal.SIGTERM)
        with Stop() as inner:
            inner.hold()
            signal.raise_signal(signal.SIGTERM)
            assert (inner.asked, outer.asked) == (True, False)
        assert signal.getsignal(signal.SIGTERM) == handler
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        assert outer.asked
