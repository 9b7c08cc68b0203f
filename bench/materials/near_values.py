"""Record what MaterialX's shaders make of lobes near by, for `tests/materials/near`.

    python bench/materials/near_values.py tests/materials/near/materialx_near.json

The cloth and its texels are those of `tests/materials/near/cloths.py`. The network is written as a
document and read back. GLSL is generated from it and run on one pixel per pair of directions under
one distant light, with textures of one texel. Needs PyPI `materialx` and `moderngl`, and EGL
(Mesa's llvmpipe is enough).
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import MaterialX as mx
import numpy as np
from lobe_values import MATRIX, shader, turned
from materialx_values import values_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from materials.near.cloths import TEXELS, far_of_two, near_mixture

from fabricusd.materials.lobes.network import lobes
from fabricusd.materials.near.inputs import Laid
from fabricusd.materials.near.maps import texel_pixels
from fabricusd.materials.near.network import NearTexel
from fabricusd.materials.networks.graph import Texture

PAIRS = 24


def main() -> None:
    w = np.random.default_rng(11).normal(size=(2, PAIRS, 3))
    w[..., 2] = np.abs(w[..., 2]) + 0.05
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    w = np.round(w, 6)
    near = near_mixture(far_of_two())
    rows = {}
    for name, texel in TEXELS.items():
        pixels = {key: row[0].tolist() for key, row in texel_pixels(texel).items()}
        laid = Laid(textures={key: Texture(Path(f"/none/{key}.exr")) for key in pixels})
        graph = lobes(
            {}, True, near.far, np.array(MATRIX), lambda b, laid=laid: NearTexel(b, near, laid)
        )
        rows[name] = values_of(*shader(graph), turned(w[0]), turned(w[1]), pixels)
    said = {
        "materialx": mx.__version__, "wi": w[0].tolist(), "wo": w[1].tolist(), "values": rows,
    }  # fmt: skip
    Path(sys.argv[1]).write_text(json.dumps(said) + "\n")


if __name__ == "__main__":
    main()
