"""The Principled BSDF of a look, rendered by Cycles."""

from __future__ import annotations

import numpy as np

from tests.materials.targets.blender.addon.blender import in_blender, interpreter


def at(degrees):
    a = np.radians(degrees)
    return [float(np.sin(a)), 0.0, float(np.cos(a))]


def test_a_viewer_below_the_plane_of_leaning_pile_sees_no_sheen(tmp_path):
    """Cycles alone shows him the sheen of a grazing view, however far below he is."""
    interpreter()
    (told,) = in_blender(
        tmp_path,
        {
            "do": "sheen_by_view", "picture": str(tmp_path / "view*.exr"), "normal": at(-65),
            "views": [at(-70), at(-20), at(24.5), at(27), at(60)],
        },
    )  # fmt: skip
    facing, turned, just_above, *below = told
    assert turned > facing > 1e-4
    # Where the sheen ends it would be .27; without fading, it would end in a line.
    assert just_above < 0.02
    assert max(below) < 1e-6
