"""Manifests, tables of lobes and frames with bytes changed: read, or refused in one line."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.images.raw import read_codes
from fabricusd.measure import read_lobes
from fabricusd.measure.capture.manifest import MANIFEST, read_manifest
from tests.fuzz import TOKENS, WORDS, damaged, examples, refusal
from tests.measure.capture.test_manifest import WHOLE
from tests.measure.shoots import shot

JUNK = (*TOKENS, b"null", b"true", b"{}", b"[]", b"1e400", b"-5", b'"half"', b"phi_d")


SMALL = json.dumps(WHOLE).encode()
TABLE = b"""# fabricusd lobes 1
# name: linen
# absolute: yes
theta_i,theta_o,phi_d,f_r,f_g,f_b,sigma_r,sigma_g,sigma_b
15,-20,0,0.1,0.2,0.3,0.01,0.01,0.01
15,-10,48,0.12,0.22,0.32,0.01,0.01,0.01
30,50.5,180,0.04,0.03,0.02,1e-3,1e-3,1e-3
"""


def test_what_is_damaged_below_is_good_by_itself(folder):
    (folder / MANIFEST).write_bytes(SMALL)
    assert refusal(read_manifest, folder) == ""
    (folder / "lobes.csv").write_bytes(TABLE)
    assert refusal(read_lobes, folder / "lobes.csv") == ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("damaged")


@settings(max_examples=examples(150, 5000))
@given(st.data())
def test_a_damaged_manifest_is_read_or_refused_in_one_line(folder, data):
    text = damaged(lambda a, b: data.draw(st.integers(a, b)), [SMALL], JUNK, 4)
    (folder / MANIFEST).write_bytes(text)
    said = refusal(read_manifest, folder)
    assert "did not expect this" not in said


@settings(max_examples=examples(150, 5000))
@given(st.data())
def test_a_damaged_table_is_read_or_refused_in_one_line(folder, data):
    path = folder / "lobes.csv"
    path.write_bytes(damaged(lambda a, b: data.draw(st.integers(a, b)), [TABLE], JUNK, 4))
    said = refusal(read_lobes, path)
    assert "did not expect this" not in said


@settings(max_examples=examples(100, 5000))
@given(st.data())
def test_a_damaged_frame_is_read_or_refused_in_one_line(folder, data):
    path = folder / "frame.pgm"
    good = [next(shot().glob("view*")).read_bytes()[:2000]]
    path.write_bytes(damaged(lambda a, b: data.draw(st.integers(a, b)), good, WORDS + TOKENS, 4))
    refusal(read_codes, path)
