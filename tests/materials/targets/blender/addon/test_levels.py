"""Which mip levels of our textures Cycles reads."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from fabricusd.images.files import write_mip_exr
from tests.materials.targets.blender.addon.blender import in_blender, interpreter

SIZE, TILE = 256, 64


def rows(level):
    side = SIZE >> level
    yield np.full((side, side, 3), 0.1 * (level + 1), np.float16)


def test_cycles_reads_our_levels_from_5_2_on_and_makes_none_of_its_own(tmp_path):
    """Blender reads none that is smaller than a tile, neither of ours nor of its own."""
    interpreter()
    path = tmp_path / "levels.exr"
    levels = [partial(rows, k) for k in range(SIZE.bit_length())]
    write_mip_exr(path, levels, SIZE, tuple("RGB"), np.float16, {"oiio:ColorSpace": "Raw"})
    (told,) = in_blender(
        tmp_path, {"do": "texel_levels", "path": str(path), "folder": str(tmp_path)}
    )
    last = (SIZE // TILE).bit_length() - 1 if told["cached"] else 0
    wanted = [0.1 * (min(level, last) + 1) for level in range(SIZE.bit_length())]
    assert told["means"] == pytest.approx(wanted, rel=2e-3)
    assert not (tmp_path / "blender_tx").exists()
