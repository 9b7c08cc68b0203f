"""From photographs to lobes: right for a known thread, and honest about frames that are broken."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.thread import evaluate
from fabricusd.errors import FabricError
from fabricusd.images.raw import read_codes, write_codes
from fabricusd.measure import measure, simulate
from fabricusd.measure.gantry.simulate import Shoot
from fabricusd.schema import load
from tests.measure.shoots import SPUN, replaced, shot, spoilt

FIRST = "view_00000_00_0.pgm"


def errors(lobes):
    return lobes.f / evaluate(SPUN, lobes.wi, lobes.wo, "microcylinder") - 1


def test_lobes_of_a_known_thread_are_unbiased_and_as_uncertain_as_they_say():
    made = measure(shot())
    off = errors(made.lobes)
    assert abs(off.mean()) < 0.005
    assert np.sqrt((off**2).mean()) < 0.015
    chi2 = ((off * evaluate(SPUN, made.lobes.wi, made.lobes.wo) / made.lobes.sigma) ** 2).mean()
    assert 0.6 < chi2 < 1.6
    assert made.lobes.absolute
    assert (made.lobes.notes, made.skipped) == ((), 0)


def test_the_printed_form_loses_light_that_ours_keeps():
    def bias(bits, **told):
        return errors(measure(shot(bits), **told).lobes).mean()

    printed = {"hdr": "thesis", "background": "zero"}
    for bits, most in ((12, 0.005), (8, 0.02)):
        assert bias(bits, **printed) < -0.07
        assert abs(bias(bits)) < most


def test_lobes_do_not_depend_on_the_number_of_workers():
    one, three = measure(shot(), workers=1).lobes, measure(shot(), workers=3).lobes
    np.testing.assert_array_equal(one.f, three.f)
    np.testing.assert_array_equal(one.sigma, three.sigma)


def test_the_diameter_comes_from_the_focused_shot_where_none_is_stated(tmp_path):
    made = measure(spoilt(tmp_path, lambda m: m.pop("diameter_px")))
    assert made.diameter == pytest.approx(5.0, rel=0.03)
    assert "by the focused shot" in made.lobes.notes[0]


def test_without_a_diameter_lobes_are_relative_and_say_so(tmp_path):
    def change(manifest):
        manifest.pop("diameter_px")
        manifest["shots"] = [s for s in manifest["shots"] if s["kind"] != "focused"]

    lobes = measure(spoilt(tmp_path, change)).lobes
    assert not lobes.absolute
    assert "relative" in lobes.notes[0]
    ratio = lobes.f / measure(shot()).lobes.f
    np.testing.assert_allclose(ratio, 5.0, rtol=1e-9)


def frame_of(folder):
    return (folder / FIRST).read_bytes()


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda f: replaced(f, FIRST, frame_of(f)[:3000]), f"{FIRST} is not whole"),
        (lambda f: replaced(f, FIRST, b"P5\n"), f"{FIRST} "),
        (lambda f: replaced(f, FIRST, b""), f"{FIRST} is empty"),
        (lambda f: (f / FIRST).unlink(), f"{FIRST} cannot be read: No such file"),
        (
            lambda f: write_codes(f / FIRST, np.zeros((40, 96), np.uint16)),
            f"{FIRST} has 96 x 40 pixels; it must have 96 x 48",
        ),
        (
            lambda f: write_codes(f / FIRST, np.full((48, 96), 60000, np.uint16)),
            f"{FIRST} holds the code 60000; with 12 bits it must be at most 4095",
        ),
    ],
)
def test_a_view_with_a_broken_frame_is_left_out_and_named(spoil, said, tmp_path):
    folder = spoilt(tmp_path, lambda m: None)
    if (folder / FIRST).is_symlink():
        data = frame_of(folder)
        replaced(folder, FIRST, data)
    spoil(folder)
    made = measure(folder)
    assert made.skipped == 1
    (note,) = [n for n in made.lobes.notes if "left out" in n]
    assert said in note
    assert note.startswith("view theta_i 0, theta_o -70, phi_d 0: ")
    assert len(made.lobes) == made.views - 1


def test_a_view_that_is_saturated_everywhere_is_left_out(tmp_path):
    folder = spoilt(tmp_path, lambda m: None)
    for frame in folder.glob("view_00003_*"):
        frame.unlink()
        write_codes(frame, np.full((48, 96), 4095, np.uint16))
    made = measure(folder)
    assert made.skipped == 1
    assert any("sites are saturated in every exposure; add a shorter one" in n
               for n in made.lobes.notes)  # fmt: skip


def test_a_broken_frame_of_the_chart_is_left_out_and_the_rest_is_enough(tmp_path):
    folder = spoilt(tmp_path, lambda m: None)
    replaced(folder, "chart_05_2.pgm", b"no picture")
    made = measure(folder)
    assert made.skipped == 0
    assert any("chart_05_2.pgm" in n for n in made.lobes.notes)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda f: [replaced(f, p.name, b"no") for p in f.glob("white*")], "white"),
        (lambda f: [replaced(f, p.name, b"no") for p in f.glob("dark*")], "no dark frame that can"),
        (lambda f: [replaced(f, p.name, b"no") for p in f.glob("chart*")], "0 exposure(s) of the"),
        (lambda f: [replaced(f, p.name, b"no") for p in f.glob("view*")], "no view that can be"),
    ],
)
def test_a_folder_whose_calibration_cannot_be_read_is_refused(spoil, said, tmp_path):
    folder = spoilt(tmp_path, lambda m: None)
    spoil(folder)
    with pytest.raises(FabricError) as error:
        measure(folder)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_dark_frames_of_a_bright_room_are_refused(tmp_path):
    folder = spoilt(tmp_path, lambda m: None)
    for frame in folder.glob("dark*"):
        frame.unlink()
        os.symlink(folder / "chart_08_0.pgm", frame)
    with pytest.raises(FabricError, match="they must be even: was the lens covered"):
        measure(folder)


def test_a_saturated_white_tile_is_refused(tmp_path):
    folder = spoilt(tmp_path, lambda m: None)
    for frame in folder.glob("white*"):
        frame.unlink()
        write_codes(frame, np.full((48, 96), 4095, np.uint16))
    with pytest.raises(FabricError, match="white tile that is saturated in every exposure"):
        measure(folder)


def test_codes_too_coarse_for_the_noise_are_noted():
    (note,) = measure(shot(8)).lobes.notes
    assert note.startswith("the noise of dark frames is 0.")
    assert "values of dim views are off by more than their deviations" in note


def test_a_hot_site_of_the_sensor_spoils_nothing(tmp_path):
    folder = spoilt(tmp_path, lambda m: None)
    # A site that is bright in the dark too, in the thread's window.
    for frame in [*folder.glob("dark*"), *folder.glob("white*"), *folder.glob("view*")]:
        codes = read_codes(frame).copy()
        codes[20, 49] = 4095
        frame.unlink()
        write_codes(frame, codes)
    made = measure(folder)
    assert made.skipped == 0
    assert made.lobes.notes == ("1 hot site(s) of the sensor are replaced by their neighbours",)
    assert abs(errors(made.lobes).mean()) < 0.01


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"window": [0, 96]}, "four of background"),
        ({"window": [10, 200]}, "they must lie within its frames of 96 x 48"),
        ({"rows": [0, 90]}, "they must lie within its frames of 96 x 48"),
    ],
)
def test_a_window_outside_of_the_frame_is_refused(change, said, tmp_path):
    with pytest.raises(FabricError) as error:
        measure(spoilt(tmp_path, lambda m: m.update(change)))
    assert said in str(error.value)


def test_a_gap_between_angles_is_noted(tmp_path):
    def change(manifest):
        manifest["shots"] = [
            s for s in manifest["shots"]
            if not (s.get("theta_i") == 0 and -45 < s.get("theta_o", 99) < -15)
        ]  # fmt: skip

    notes = measure(spoilt(tmp_path, change)).lobes.notes
    assert notes == (
        "incidence 0, azimuth 0: there are no views between theta_o -50 and -10 degrees",
    )


def test_single_shots_have_an_assumed_deviation_and_say_so(tmp_path):
    def change(manifest):
        manifest["shots"] = [s for s in manifest["shots"] if not s["file"].endswith("_1.pgm")]

    lobes = measure(spoilt(tmp_path, change)).lobes
    assert any("no two shots" in n for n in lobes.notes)
    assert (lobes.sigma > 0).all()


def test_an_option_that_does_not_exist_is_refused():
    for told in ({"hdr": "mean"}, {"background": "blue"}):
        with pytest.raises(FabricError, match="it must be one of"):
            measure(shot(), **told)


def test_rows_and_window_can_be_chosen(tmp_path):
    told = {"rows": [8, 40], "window": [30, 66]}
    lobes = measure(spoilt(tmp_path, lambda m: m.update(told))).lobes
    # Half of the thread is as bright as all of it but for its unevenness.
    assert abs(errors(lobes).mean()) < 0.03


def test_rayon_has_the_facts_that_are_stated_of_it_relative_to_its_peak(tmp_path):
    """[Bisker2011] 3.3.1, lit at 15 degrees: a floor of a tenth of the peak, which lies near the
    mirror direction, and a lobe about 30 degrees wide."""
    rayon = load("thread_rayon_spun{appearance=published}").thread_list[0]
    simulate(rayon, tmp_path / "shoot", shoot=Shoot(design="incidence"))
    lobes = measure(tmp_path / "shoot").lobes
    theta, f = np.degrees(lobes.theta_o), lobes.f.mean(axis=1)
    peak = int(np.argmax(f))
    assert theta[peak] == pytest.approx(-15, abs=6)
    assert np.median(f[np.abs(theta - 45) < 20]) / f[peak] == pytest.approx(0.1, abs=0.03)
    above = theta[f > 0.5 * f[peak]]
    assert above.max() - above.min() == pytest.approx(30, abs=6)


def test_lobes_are_the_values_of_their_rows():
    lobes = measure(shot()).lobes
    some = lobes.of(np.array([0, 2]))
    np.testing.assert_array_equal(some.f, lobes.f[[0, 2]])
    assert replace(some, notes=()).name == "linen"
