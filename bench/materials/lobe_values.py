"""Record what MaterialX's shaders make of a look of lobes, for `tests/materials/lobes`.

    python bench/materials/lobe_values.py tests/materials/lobes/materialx_lobes.json

The look of each preset is written as a document and read back. GLSL is generated from it and run on
one pixel per pair of directions under one distant light. Needs PyPI `materialx` and `moderngl`, and
EGL (Mesa's llvmpipe is enough).
"""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import MaterialX as mx
import numpy as np
from materialx_values import generated, values_of, with_library

from fabricusd.materials.lobes.known import mixture_of
from fabricusd.materials.lobes.mixture import MATERIALX
from fabricusd.materials.lobes.network import lobes
from fabricusd.materials.targets.mtlx import write_mtlx
from fabricusd.schema import load

PAIRS = 48
PRESETS = (("silk_crepe_de_chine", 4), ("velvet", 4), ("linen_plain", 4))

MATRIX = ((30.0, 12.0), (-16.0, 40.0))
"""From texture coordinates to threads: turned, and of another density in each set. The threads stay
at a right angle."""


def shader(graph):
    """Vertex and fragment shader of a look's document."""
    document = with_library()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "look.mtlx"
        write_mtlx(path, [("look", graph, {})])
        mx.readFromXmlFile(document, str(path))
    return generated(document, document.getNode("look_surface"))


def turned(w):
    """(n, 3) directions on a mesh whose tangents are x and y, from those along the threads."""
    u = np.array(MATRIX[0]) / np.hypot(*MATRIX[0])
    return w @ np.array([[u[0], u[1], 0.0], [-u[1], u[0], 0.0], [0.0, 0.0, 1.0]])


def main() -> None:
    w = np.random.default_rng(7).normal(size=(2, PAIRS, 3))
    w[..., 2] = np.abs(w[..., 2]) + 0.05
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    w = np.round(w, 6)
    rows = []
    for name, count in PRESETS:
        mixture = mixture_of(load(name), count, MATERIALX)
        graph = lobes({}, True, mixture, np.array(MATRIX))
        values = values_of(*shader(graph), turned(w[0]), turned(w[1]))
        rows.append({"preset": name, "mixture": asdict(mixture), "values": values})
    said = {
        "materialx": mx.__version__, "matrix": MATRIX, "wi": w[0].tolist(), "wo": w[1].tolist(),
        "rows": rows,
    }  # fmt: skip
    Path(sys.argv[1]).write_text(json.dumps(said) + "\n")


if __name__ == "__main__":
    main()
