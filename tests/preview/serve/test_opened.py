"""Files that are dropped on the page: what is read, and what is refused."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, Weave
from fabricusd.preview.png import png_bytes
from fabricusd.preview.serve import wanted
from fabricusd.preview.serve.opened import SUFFIXES, opened
from fabricusd.schema.write import save, usd_text
from fabricusd.weaves import from_fabric, wif_text
from fabricusd.weaves.readers import READERS


def sent(content: bytes | str) -> str:
    return base64.b64encode(content.encode() if isinstance(content, str) else content).decode()


def test_a_fabric_s_own_text_is_opened():
    fabric, _ = opened("my cloth.usda", sent(usd_text(Fabric(name="Mine"))))
    assert fabric == Fabric(name="Mine")


def test_a_draft_is_opened_by_the_name_of_its_file():
    fabric, _ = opened("twill 2.wif", sent(wif_text(from_fabric(Fabric()))))
    assert fabric.name == "twill_2"
    assert np.array_equal(fabric.weave.cells, Fabric().weave.cells)


def test_an_image_of_a_weave_is_opened():
    pixels = np.where(np.eye(4, dtype=bool)[..., None], 0, 255).repeat(3, -1).astype(np.uint8)
    fabric, _ = opened("twill.png", sent(png_bytes(pixels)))
    assert fabric.weave.cells.shape == (4, 4)
    assert fabric.weave.cells.sum() == 4


OUTSIDE = {
    "a sublayer": "#usda 1.0\n(\nsubLayers = [\n@SECRET@\n]\n)\n",
    "a reference": '#usda 1.0\ndef "A" (\nreferences = @SECRET@\n) {\n}\n',
    "a payload": '#usda 1.0\ndef "A" (\npayload = @SECRET@</Fabric>\n) {\n}\n',
    "a reference in a variant": (
        '#usda 1.0\ndef "A" (\nvariants = {\nstring v = "x"\n}\nprepend variantSets = "v"\n) {\n'
        'variantSet "v" = {\n"x" (\nreferences = @SECRET@\n) {\n}\n}\n}\n'
    ),
    "clips": (
        '#usda 1.0\ndef "A" (\nclips = {\ndictionary default = {\nasset[] assetPaths = [@SECRET@]\n'
        'string primPath = "/Fabric"\n}\n}\n) {\n}\n'
    ),
}


@pytest.mark.parametrize("text", OUTSIDE.values(), ids=OUTSIDE)
def test_a_file_that_names_another_one_is_refused_unread(tmp_path, text):
    secret = tmp_path / "secret.usda"
    save(Fabric(documentation="must-not-be-read"), secret)
    with pytest.raises(FabricError, match="refers to") as caught:
        opened("a.usda", sent(text.replace("SECRET", str(secret))))
    assert "must-not-be-read" not in str(caught.value)


def test_references_inside_the_file_are_followed():
    text = usd_text(Fabric(name="Base")) + '\ndef "Worn" (\nprepend references = </Base>\n) {\n}\n'
    assert opened("a.usda", sent(text))[0].weave == Fabric().weave


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.usdc", b"PXR-USDC", "cannot be opened; it must be one of .wif, .usda"),
        ("../../etc/passwd", b"x", "passwd cannot be opened"),
        ("a.png", b"#EXTM3U\n/etc/passwd\n", "is no .png file by its first bytes"),
        ("a.usda", b"PXR-USDC\0", "is no .usda file by its first bytes"),
        ("a.wif", b"", "is empty"),
        ("a.usda", b"#usda 1.0\ndef {{", "a.usda cannot be parsed as USD"),
    ],
)
def test_what_is_no_such_file_is_refused_in_one_line(name, content, said):
    with pytest.raises(FabricError) as caught:
        opened(name, sent(content))
    assert said in str(caught.value)
    assert "fabricusd-" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_weave_that_is_too_large_is_refused_before_it_is_dyed(monkeypatch):
    monkeypatch.setattr(wanted, "MOST_CELLS", 9)
    draft = wif_text(from_fabric(Fabric(weave=Weave(np.eye(4, dtype=bool)))))
    with pytest.raises(FabricError, match="has 16 cells; it must have at most 9"):
        opened("a.wif", sent(draft))


def test_every_kind_that_is_opened_has_a_reader_or_is_usd():
    known = {suffix for suffixes in READERS.values() for suffix in suffixes}
    assert set(SUFFIXES) <= known | {".usda"}
