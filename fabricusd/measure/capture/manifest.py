"""What a folder of photographs holds: `manifest.json`, checked before a frame is read."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fabricusd.errors import FabricError, did_you_mean, one_line, reads
from fabricusd.files import readable_file
from fabricusd.measure.angles import DEGREE, degrees_key, folded

MANIFEST = "manifest.json"
VERSION = 1
KINDS = ("chart", "dark", "white", "focused", "slice", "half")
VIEWS = ("slice", "half")
PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG", "grey")
BITS = tuple(range(8, 17))

KNOWN = (
    "fabricusd:measurement", "name", "bits", "pattern", "linear", "diameter_px", "white", "chart",
    "window", "rows", "shots", "note",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One frame.

    file : in the folder; kind : one of KINDS; exposure : [s]
    theta_i, theta_o, phi_d : of views [rad]
    """

    file: str
    kind: str
    exposure: float
    theta_i: float = 0.0
    theta_o: float = 0.0
    phi_d: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """A folder of photographs of one thread.

    folder : Path; name : of the thread; bits : of a code
    pattern : of the colour filter, from the top left, or "grey"
    linear : whether codes are linear in light up to saturation, as raw files of cameras are
    diameter : of the imaged thread [pixels], or None if it was not measured
    reflectance, white_angle : (3,) factor of the white tile seen face on, and its light's angle
    chart : (rows, columns) of grey patches that fill the frames of the chart
    window : (left, right) columns that hold the thread in every view, or None for the middle two
        thirds; what lies beside them is background
    rows : (top, bottom) that are used, or None for all
    shots : that can be used; notes : a line for each that cannot
    """

    folder: Path
    name: str
    bits: int
    pattern: str = "RGGB"
    linear: bool = False
    diameter: float | None = None
    reflectance: tuple[float, float, float] = (0.989, 0.989, 0.988)
    white_angle: float = 8.0 * DEGREE
    chart: tuple[int, int] = (4, 6)
    window: tuple[int, int] | None = None
    rows: tuple[int, int] | None = None
    shots: tuple[Shot, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def levels(self) -> int:
        """The largest code."""
        return (1 << self.bits) - 1

    def of_kind(self, kind: str) -> dict[float, list[Shot]]:
        """Exposure -> its shots of one kind, the shortest first."""
        return _by_exposure([shot for shot in self.shots if shot.kind == kind])

    def views(self) -> list[list[Shot]]:
        """The shots of each view, ordered by its angles."""
        found: dict[tuple[float, ...], list[Shot]] = {}
        for shot in self.shots:
            if shot.kind in VIEWS:
                key = degrees_key(shot.theta_i, shot.theta_o, shot.phi_d)
                found.setdefault(key, []).append(shot)
        return [found[key] for key in sorted(found)]


def _by_exposure(shots: list[Shot]) -> dict[float, list[Shot]]:
    found: dict[float, list[Shot]] = {}
    for shot in shots:
        found.setdefault(shot.exposure, []).append(shot)
    return dict(sorted(found.items()))


by_exposure = _by_exposure


@reads("a manifest of photographs")
def read_manifest(folder: str | os.PathLike[str]) -> Manifest:
    """Read `manifest.json` in `folder`.

    A shot that cannot be used is left out and noted. Raises FabricError for what no measurement can
    be made with: a manifest that is not JSON, numbers out of range, no view, no white, no way to
    find the response.
    """
    where = str(readable_file(Path(folder) / MANIFEST, missing="does not exist: it must describe "
                              "the photographs, see docs/measurement.md"))  # fmt: skip
    try:
        given = json.loads(Path(where).read_text("utf-8-sig"))
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise FabricError(where, f"is not JSON: {one_line(str(error), 120)}") from None
    if not isinstance(given, dict):
        raise FabricError(where, "is not a JSON object; it must have the key 'shots'")
    for key in given:
        if key not in KNOWN:
            raise FabricError(where, f"has the unknown key '{one_line(key, 40)}'"
                              f"{did_you_mean(key, KNOWN)}")  # fmt: skip
    if given.get("fabricusd:measurement", VERSION) != VERSION:
        raise FabricError(where, f"is of version {given['fabricusd:measurement']!r}; it must be "
                          f"{VERSION}")  # fmt: skip
    listed = given.get("shots")
    if isinstance(listed, str):
        listed = _table(Path(folder) / listed)
    if not isinstance(listed, list) or not listed:
        raise FabricError(where, "has no 'shots'; it must list the frames, or name a CSV of them")
    shots, notes = [], []
    for k, one in enumerate(listed):
        shot = _shot(one, k)
        if isinstance(shot, str):
            notes.append(shot)
        else:
            shots.append(shot)
    made = Manifest(folder=Path(folder), shots=tuple(shots), notes=tuple(notes),
                    **_settings(where, given))  # fmt: skip
    _require_enough(where, made)
    return made


def _settings(where: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Everything but the shots."""
    white, chart = given.get("white", {}), given.get("chart", {})
    for key, value in (("white", white), ("chart", chart)):
        if not isinstance(value, dict):
            raise FabricError(where, f"has '{key}' that is not an object")
    bits = given.get("bits")
    if bits not in BITS or isinstance(bits, bool):
        raise FabricError(where, f"has bits {bits!r}; it must be a whole number from 8 to 16")
    pattern = given.get("pattern", "RGGB")
    if pattern not in PATTERNS:
        raise FabricError(
            where, f"has the pattern {pattern!r}; it must be one of {', '.join(PATTERNS)}"
        )
    told: dict[str, Any] = {
        "name": one_line(str(given.get("name", "thread")), 80) or "thread",
        "bits": bits,
        "pattern": pattern,
        "linear": given.get("linear", False),
    }
    if not isinstance(told["linear"], bool):
        raise FabricError(where, f"has linear {told['linear']!r}; it must be true or false")
    diameter = given.get("diameter_px")
    if diameter is not None:
        told["diameter"] = _number(where, "diameter_px", diameter, 0.1, 1e5)
    if "reflectance" in white:
        factors = white["reflectance"]
        if not isinstance(factors, list) or len(factors) != 3:
            raise FabricError(where, "has a white.reflectance that is not three numbers")
        told["reflectance"] = tuple(
            _number(where, "white.reflectance", x, 0.01, 2.0) for x in factors
        )
    if "angle" in white:
        told["white_angle"] = _number(where, "white.angle", white["angle"], -89, 89) * DEGREE
    if chart:
        told["chart"] = tuple(
            int(_number(where, f"chart.{side}", chart.get(side), 1, 100))
            for side in ("rows", "columns")
        )
    for key in ("window", "rows"):
        if given.get(key) is not None:
            pair = given[key]
            if not isinstance(pair, list) or len(pair) != 2:
                raise FabricError(where, f"has '{key}' {pair!r}; it must be two numbers of pixels")
            low, high = (int(_number(where, key, x, 0, 1e5)) for x in pair)
            if high - low < 2:
                raise FabricError(where, f"has '{key}' {pair!r}; the second must be larger by 2")
            told[key] = (low, high)
    return told


def _number(where: str, key: str, value: Any, low: float, high: float) -> float:
    whole = isinstance(value, int | float) and not isinstance(value, bool)
    if not whole or not low <= float(value) <= high:
        raise FabricError(
            where, f"has {key} {value!r}; it must be a number from {low:g} to {high:g}"
        )
    return float(value)


def _shot(one: Any, k: int) -> Shot | str:
    """A shot, or a line that says why it is left out."""
    if not isinstance(one, dict) or not isinstance(one.get("file"), str) or not one["file"]:
        return f"shot {k}: it names no file; left out"
    file = one_line(one["file"], 120)
    kind = one.get("kind")
    if kind not in KINDS:
        return f"{file}: its kind is {kind!r}; it must be one of {', '.join(KINDS)}; left out"
    numbers = {}
    for key, low, high in _wanted(str(kind)):
        value = one.get(key)
        try:
            number = math.nan if isinstance(value, bool) or value is None else float(value)
        except (TypeError, ValueError):
            number = math.nan
        if not low <= number <= high:
            lack = "there is no" if value in (None, "") else f"{one_line(str(value), 20)} is no"
            return f"{file}: {lack} {key} from {low:g} to {high:g}; left out"
        numbers[key] = number
    if not numbers["exposure"] > 0:
        return f"{file}: its exposure is 0 s; it must be above 0; left out"
    angles: dict[str, float] = {
        key: numbers[key] * DEGREE for key in ("theta_i", "theta_o") if key in numbers
    }
    if "phi_d" in numbers:
        angles["phi_d"] = float(folded(numbers["phi_d"] * DEGREE))
    return Shot(file=one["file"], kind=str(kind), exposure=numbers["exposure"], **angles)


def _wanted(kind: str) -> tuple[tuple[str, float, float], ...]:
    """(key, smallest, largest) of the numbers that a shot of this kind must have."""
    exposure = ("exposure", 0.0, 3600.0)
    if kind not in VIEWS:
        return (exposure,)
    angles = (("theta_i", -89.0, 89.0), ("theta_o", -89.9, 89.9))
    azimuth = (("phi_d", -360.0, 360.0),) if kind == "half" else ()
    return (exposure, *angles, *azimuth)


def _table(path: Path) -> list[dict[str, Any]]:
    """The rows of a CSV whose header has the keys of shots."""
    text = readable_file(path).read_text("utf-8-sig")
    rows = csv.DictReader(io.StringIO(text))
    return [{key: value for key, value in row.items() if key and value} for row in rows]


def _require_enough(where: str, made: Manifest) -> None:
    """Raise for a folder that no thread can be measured from."""
    left_out = f"; {made.notes[0]}" if made.notes else ""
    if not made.views():
        raise FabricError(where, f"has no shots of kind slice or half that can be used{left_out}")
    if not made.of_kind("white"):
        raise FabricError(
            where, f"has no shots of kind white; without one there is no reference{left_out}"
        )
    if not made.linear and not made.of_kind("chart"):
        raise FabricError(
            where, "has no shots of kind chart, which tell the response of the camera; add them, "
            f"or state \"linear\": true{left_out}",
        )  # fmt: skip
    if not made.of_kind("dark"):
        raise FabricError(where, f"has no shots of kind dark, which tell the black level{left_out}")
    for shot in made.shots:
        if os.path.isabs(shot.file) or ".." in Path(shot.file).parts:
            raise FabricError(f"{where}: {one_line(shot.file, 120)}", "lies outside of the folder")
