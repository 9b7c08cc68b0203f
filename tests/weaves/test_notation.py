"""Colours as laboratories give them, under D65."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.weaves import parse_color

WAVELENGTHS = np.arange(380, 781, 10)


def spectrum(tmp_path, values) -> str:
    path = tmp_path / "spectrum.csv"
    lines = [f"{w},{v}" for w, v in zip(WAVELENGTHS, values, strict=True)]
    path.write_text("\n".join(["wavelength,r", *lines]))
    return str(path)


@pytest.mark.parametrize("observer", [2, 10])
@pytest.mark.parametrize("text", ["lab(100, 0, 0)", "lch(100 0 90)"])
def test_the_white_of_d65_is_white(text, observer):
    assert parse_color(text, observer=observer) == pytest.approx((1, 1, 1), abs=2e-4)


def test_lab_and_lch_agree_and_are_under_d65():
    lab = parse_color("lab(53.24, 80.09, 67.2)")
    assert lab == pytest.approx((1, 0, 0), abs=2e-3)
    assert parse_color("lch(53.24, 104.55, 40)") == pytest.approx(lab, abs=2e-3)


def test_xyy_has_its_luminance_to_100():
    assert parse_color("xyY(0.3127, 0.329, 18)") == pytest.approx((0.18,) * 3, abs=1e-3)


def test_css_names_are_display_codes():
    assert parse_color("navy") == parse_color("Navy") == parse_color("#000080")


def test_a_colour_outside_of_rec_709_keeps_its_numbers_below_0():
    assert min(parse_color("lch(70, 90, 200)")) < 0


@pytest.mark.parametrize("observer", [2, 10])
def test_a_flat_spectrum_is_grey(tmp_path, observer):
    path = spectrum(tmp_path, np.full(len(WAVELENGTHS), 0.4))
    assert parse_color(path, observer=observer) == pytest.approx((0.4,) * 3, rel=2e-3)


def test_a_spectrum_without_the_blue_is_yellow(tmp_path):
    r, g, b = parse_color(spectrum(tmp_path, np.where(WAVELENGTHS < 500, 0.05, 0.6)))
    assert b < 0.15 < g < r


@pytest.mark.parametrize("text", ["lab(50, 0)", "lch(50, -1, 0)", "xyY(0.3, 0, 5)", "lab(a,b,c)"])
def test_numbers_of_another_kind_are_refused(text):
    with pytest.raises(FabricError, match="must have three numbers"):
        parse_color(text)


def test_a_spectrum_in_percent_or_of_nothing_is_refused(tmp_path):
    with pytest.raises(FabricError, match="holds no reflectances"):
        parse_color(spectrum(tmp_path, np.full(len(WAVELENGTHS), 40)))
    with pytest.raises(FabricError, match="which is no file"):
        parse_color(str(tmp_path / "none.csv"))
    (tmp_path / "odd.csv").write_text("hello")
    with pytest.raises(FabricError, match="it must have a header"):
        parse_color(str(tmp_path / "odd.csv"))
