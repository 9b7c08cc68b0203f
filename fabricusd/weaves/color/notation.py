"""Colours as textile laboratories give them: CSS names, lab(), lch(), xyY() and measured spectra.

All are under CIE D65, unlike the lab() of CSS, which is under D50. Those of the 10 degree observer
are adapted to the white of the 2 degree observer (Bradford), for which linear Rec. 709 is defined:
a neutral colour stays neutral.
"""

from __future__ import annotations

import math
import os
import re
import warnings
from typing import Any

import numpy as np

from fabricusd.errors import FabricError, did_you_mean, one_line
from fabricusd.srgb import linear_from_srgb

RGB = tuple[float, float, float]

FORMS = (
    "#rrggbb, a CSS name, lab(L, a, b), lch(L, C, h), xyY(x, y, Y) with Y to 100, all under D65, "
    "a spectrum.csv, or three linear numbers, as in 0.2,0.8,1"
)
"""What a colour may be."""

OBSERVERS = {
    2: "CIE 1931 2 Degree Standard Observer",
    10: "CIE 1964 10 Degree Standard Observer",
}
"""Field of view [degrees] -> the name of the standard observer in colour-science."""

_CALL = re.compile(r"(lab|lch|xyy)\s*\(([^()]*)\)", re.IGNORECASE)

_LIMITS = {
    "lab": ((0, 100), (-200, 200), (-200, 200)),
    "lch": ((0, 100), (0, 200), (-360, 360)),
    "xyy": ((0, 1), (1e-6, 1), (0, 100)),
}
"""Smallest and largest number of each form."""


def parse_notation(text: str, where: str, observer: int = 2) -> RGB | None:
    """A linear Rec. 709 colour, below 0 outside of its gamut; None for text of another form.

    Raises FabricError, naming `where`, for a form with numbers that are none or out of range, for
    a name that CSS does not have, and for a spectrum that cannot be read.
    """
    word = text.strip()
    if found := _CALL.fullmatch(word):
        return _called(found[1].lower(), found[2], where, word, observer)
    if word.lower().endswith(".csv"):
        return _spectrum(word, where, observer)
    if word.isalpha():
        return _named(word, where)
    return None


def _called(form: str, inside: str, where: str, word: str, observer: int) -> RGB:
    try:
        numbers = [float(part) for part in re.split(r"[,\s]+", inside.strip())]
    except ValueError:
        numbers = []
    limits = _LIMITS[form]
    good = len(numbers) == 3 and all(
        math.isfinite(x) and low <= x <= high
        for x, (low, high) in zip(numbers, limits, strict=True)
    )
    if not good:
        ranges = ", ".join(f"{low:g} to {high:g}" for low, high in limits)
        raise FabricError(
            where,
            f"is '{one_line(word, 40)}'; {form.replace('yy', 'yY')}() must have three numbers, "
            f"{ranges}",
        )
    colour = _colour()
    white = _white(observer)
    if form == "xyy":
        x, y, luminance = numbers
        return _from_xyz(colour.xyY_to_XYZ([x, y, luminance / 100]), observer)
    if form == "lch":
        lightness, chroma, hue = numbers
        turn = math.radians(hue)
        numbers = [lightness, chroma * math.cos(turn), chroma * math.sin(turn)]
    return _from_xyz(colour.Lab_to_XYZ(numbers, white), observer)


def _named(word: str, where: str) -> RGB:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from colour.notation.datasets import CSS_COLOR_3
    known = {name.lower(): value for name, value in CSS_COLOR_3.items()}
    if word.lower() not in known:
        raise FabricError(
            where,
            f"is '{one_line(word, 40)}'{did_you_mean(word.lower(), known)}; it must be {FORMS}",
        )
    digits = known[word.lower()].lstrip("#")
    r, g, b = linear_from_srgb([int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)])
    return float(r), float(g), float(b)


def _spectrum(path: str, where: str, observer: int) -> RGB:
    """The colour of the first spectrum of a CSV file: wavelength [nm], reflectance 0 to 1."""
    if not os.path.isfile(path):
        raise FabricError(where, f"is '{one_line(path, 80)}', which is no file")
    colour = _colour()
    accepted = (
        "it must have a header, and lines of a wavelength in nm and a reflectance from 0 to 1"
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read = colour.read_sds_from_csv_file(path)
            found = next(iter(read.values()))
            wavelengths, values = np.array(found.wavelengths), np.array(found.values)
    except Exception as error:  # Of whatever kind the reader raises.
        raise FabricError(where, f"'{one_line(path, 80)}' cannot be read; {accepted}") from error
    sound = (
        len(values) >= 2
        and np.isfinite(wavelengths).all()
        and np.isfinite(values).all()
        and values.min() >= 0
        and values.max() <= 2
    )
    if not sound:
        raise FabricError(where, f"'{one_line(path, 80)}' holds no reflectances; {accepted}")
    if wavelengths.min() > 430 or wavelengths.max() < 660:
        raise FabricError(
            where,
            f"'{one_line(path, 80)}' covers {wavelengths.min():g} to {wavelengths.max():g} nm; it "
            "must cover 430 to 660 nm at least",
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        xyz = colour.sd_to_XYZ(
            found,
            cmfs=colour.MSDS_CMFS[OBSERVERS[observer]],
            illuminant=colour.SDS_ILLUMINANTS["D65"],
        )
    return _from_xyz(np.asarray(xyz) / 100.0, observer)


def _white(observer: int) -> Any:
    return _colour().CCS_ILLUMINANTS[OBSERVERS[observer]]["D65"]


def _from_xyz(xyz: Any, observer: int) -> RGB:
    colour = _colour()
    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    if observer != 2:
        ends = (colour.xy_to_XYZ(_white(field)) for field in (observer, 2))
        xyz = colour.chromatic_adaptation(xyz, *ends, method="Von Kries", transform="Bradford")
    r, g, b = (float(x) for x in colour.XYZ_to_RGB(xyz, space))
    return r, g, b


def _colour() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour
