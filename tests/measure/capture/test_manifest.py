"""Manifests: what is refused, what is left out with a note, and what is read."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.measure.capture.manifest import MANIFEST, read_manifest

VIEW = {
    "file": "v.pgm", "kind": "slice", "exposure": 0.1, "theta_i": 15, "theta_o": -20, "phi_d": 0,
}  # fmt: skip
WHOLE: dict[str, Any] = {
    "bits": 12,
    "shots": [
        *({"file": f"{kind}.pgm", "kind": kind, "exposure": 0.1}
          for kind in ("dark", "white", "chart")),
        VIEW,
    ],
}  # fmt: skip


def read(tmp_path, given):
    text = given if isinstance(given, str) else json.dumps(given)
    (tmp_path / MANIFEST).write_text(text)
    return read_manifest(tmp_path)


def without(kind: str) -> dict[str, Any]:
    return {**WHOLE, "shots": [s for s in WHOLE["shots"] if s["kind"] != kind]}


def test_a_manifest_without_faults_is_read_as_it_stands(tmp_path):
    made = read(tmp_path, {**WHOLE, "name": "linen", "diameter_px": 4.5, "window": [10, 30]})
    assert (made.name, made.bits, made.diameter, made.window) == ("linen", 12, 4.5, (10, 30))
    assert made.levels == 4095
    (view,) = made.views()
    assert np.degrees(view[0].theta_o) == pytest.approx(-20)
    assert made.notes == ()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("{", "is not JSON"),
        ("[]", "is not a JSON object"),
        ({}, "has no 'shots'"),
        ({**WHOLE, "shots": []}, "has no 'shots'"),
        ({**WHOLE, "bitz": 12}, "has the unknown key 'bitz' (did you mean 'bits'?)"),
        ({**WHOLE, "bits": 7}, "has bits 7; it must be a whole number from 8 to 16"),
        ({**WHOLE, "bits": None}, "has bits None"),
        ({**WHOLE, "pattern": "RGB"}, "has the pattern 'RGB'; it must be one of RGGB"),
        ({**WHOLE, "linear": 1}, "has linear 1; it must be true or false"),
        ({**WHOLE, "diameter_px": 0}, "has diameter_px 0; it must be a number from 0.1"),
        ({**WHOLE, "white": 3}, "has 'white' that is not an object"),
        ({**WHOLE, "white": {"reflectance": [1, 1]}}, "white.reflectance that is not three"),
        ({**WHOLE, "chart": {"rows": 4}}, "has chart.columns None"),
        ({**WHOLE, "window": [5, 5]}, "the second must be larger by 2"),
        ({**WHOLE, "fabricusd:measurement": 9}, "is of version 9; it must be 1"),
        (without("chart"), "has no shots of kind chart, which tell the response"),
        (without("white"), "has no shots of kind white"),
        (without("dark"), "has no shots of kind dark"),
        (without("slice"), "has no shots of kind slice or half"),
        ({**WHOLE, "shots": [*WHOLE["shots"], {**VIEW, "file": "../v.pgm"}]}, "lies outside"),
        (json.dumps({**WHOLE, "diameter_px": "D"}).replace('"D"', "NaN"), "has diameter_px nan"),
    ],
)  # fmt: skip
def test_a_folder_that_cannot_be_measured_is_refused_with_the_reason(given, said, tmp_path):
    with pytest.raises(FabricError) as error:
        read(tmp_path, given)
    assert said in str(error.value)
    assert MANIFEST in str(error.value)


def test_a_folder_without_manifest_is_refused_with_where_it_is_described(tmp_path):
    with pytest.raises(FabricError, match=r"manifest.json does not exist: .*measurement.md"):
        read_manifest(tmp_path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"exposure": None}, "there is no exposure"),
        ({"exposure": 0}, "its exposure is 0 s"),
        ({"exposure": -1}, "-1 is no exposure"),
        ({"exposure": "long"}, "long is no exposure"),
        ({"theta_o": None}, "there is no theta_o"),
        ({"theta_i": 90}, "90 is no theta_i from -89 to 89"),
        ({"kind": "sphere"}, "its kind is 'sphere'; it must be one of"),
        ({"kind": "half", "phi_d": None}, "there is no phi_d"),
    ],
)
def test_a_shot_that_cannot_be_used_is_left_out_and_named(change, said, tmp_path):
    bad = {**VIEW, "file": "bad.pgm", **change}
    bad = {key: value for key, value in bad.items() if value is not None}
    made = read(tmp_path, {**WHOLE, "shots": [*WHOLE["shots"], bad]})
    (note,) = made.notes
    assert note.startswith("bad.pgm: ")
    assert said in note
    assert len(made.shots) == len(WHOLE["shots"])


def test_nan_for_an_exposure_is_left_out(tmp_path):
    text = json.dumps({**WHOLE, "shots": [*WHOLE["shots"], {**VIEW, "exposure": "?"}]})
    made = read(tmp_path, text.replace('"?"', "NaN"))
    assert made.notes == ("v.pgm: nan is no exposure from 0 to 3600; left out",)


def test_linear_frames_need_no_chart(tmp_path):
    assert read(tmp_path, {**without("chart"), "linear": True}).linear


def test_shots_may_stand_in_a_csv(tmp_path):
    (tmp_path / "shots.csv").write_text(
        "file,kind,exposure,theta_i,theta_o\na.pgm,dark,.1,,\nb.pgm,white,.1,,\nc.pgm,chart,.1,,\n"
        "d.pgm,slice,.1,15,-20\ne.pgm,slice,,15,-20\n"
    )
    made = read(tmp_path, {"bits": 8, "shots": "shots.csv"})
    assert len(made.shots) == 4
    assert made.notes == ("e.pgm: there is no exposure from 0 to 3600; left out",)
