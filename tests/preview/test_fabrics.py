"""Which fabric a preview shows, and how it is kept."""

from __future__ import annotations

import subprocess
import sys

import pytest
from hypothesis import given, settings

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.preview.fabrics import PRESETS, fabric_of, is_preset, names_of_presets
from fabricusd.preview.stored import from_json, to_json
from tests.strategies import fabrics


@settings(max_examples=30, deadline=None)
@given(fabrics())
def test_a_fabric_is_read_as_it_was_kept(fabric: Fabric):
    assert from_json(to_json(fabric)) == fabric


def test_presets_are_where_the_schema_has_them():
    from fabricusd.schema.source import PRESETS as WANTED
    from fabricusd.schema.source import preset_names

    assert PRESETS == WANTED
    assert set(names_of_presets()) < set(preset_names())
    assert all(is_preset(name) for name in preset_names())


def test_a_preset_s_variant_is_another_fabric():
    from fabricusd.schema import load

    source = "linen_plain{appearance=published}"
    assert fabric_of(source)[0] == load(source)
    assert fabric_of(source)[0] != fabric_of("linen_plain")[0]


def test_what_is_no_fabric_is_refused_as_elsewhere():
    with pytest.raises(FabricError, match="did you mean 'velvet'"):
        fabric_of("velvt")


def test_a_preset_that_was_seen_needs_neither_usd_nor_embree(tmp_path):
    picture = str(tmp_path / "a.png")
    look = (
        "import sys; from fabricusd.cli.main import main; "
        f"main(['preview', 'linen_plain', '--size', '32', '-o', {picture!r}]); "
        "print(sorted({'pxr', 'embreex', 'OpenImageIO', 'scipy.special'} & set(sys.modules)))"
    )
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
