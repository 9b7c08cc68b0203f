"""One HTML file that shows a fabric with WebGL2, and needs nothing else: no network, no library.

The shaders' kernels are those of the path tracer, translated (`preview.glsl`). The tables that they
read are in the file, in float32.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.images import view
from fabricusd.preview.lights import Lights
from fabricusd.preview.page_tables import fabric_tables, thread_controls
from fabricusd.preview.picture import BACKGROUND
from fabricusd.preview.shapes import SHAPES, Shape
from fabricusd.preview.sheet import words

FOLDER = Path(__file__).resolve().parent / "page"

ON_PAGE = ("cylinder", "sphere", "swatch", "drape")
"""Shapes that every page has."""

MOST_BYTES = 64 << 20
"""Bytes of the largest page: browsers parse more than that slowly, and mail servers refuse it."""

LEVEL = "auto"


def page(
    fabric: Fabric,
    *,
    lights: Lights = Lights(),  # noqa: B008
    mesh: Shape | None = None,
    title: str = "",
) -> str:
    """The page of `fabric`; mesh : the user's own, of which `metres` are those on the cloth.

    Raises FabricError for a fabric whose tables do not fit into a page.
    """
    shapes = {} if mesh is None else {"scene": mesh}
    shapes.update({name: SHAPES[name](fabric) for name in ON_PAGE})
    tables, rows = fabric_tables(fabric)
    said, threads = thread_controls(fabric)
    data = {
        "name": fabric.name, "level": LEVEL, "shaders": shaders(),
        "fabric": {**tables, "ground": BACKGROUND},
        "meshes": {name: mesh_arrays(shape) for name, shape in shapes.items()},
        "light": {
            "azimuth": math.degrees(lights.azimuth), "elevation": math.degrees(lights.elevation),
            "key_power": lights.key, "even": lights.even, "slope": lights.slope,
        },
        "focal": 2.0 * 0.05 / 0.036, "rows": rows, "threads": threads,
    }  # fmt: skip
    made = _filled(data, title or fabric.name, f"{words(fabric)}. {said}")
    if len(made) > MOST_BYTES:
        raise FabricError(
            fabric.name,
            f"would be a page of {len(made) >> 20} MB; it must be at most {MOST_BYTES >> 20} MB, "
            "which a smaller repeat or mesh gives",
        )
    return made


def shaders() -> dict[str, str]:
    """The shaders' texts by name."""
    read = {path.stem: path.read_text() for path in FOLDER.glob("*.glsl")}
    kernels = read["kernels"] + read["cloth"]
    return {
        "vertex": read["vertex"], "screen": read["screen"], "sum": read["sum"],
        "surface": kernels + read["surface"],
        "display": read["display"].replace("ACES_SCALE", repr(view._SCALE)),
    }  # fmt: skip


def mesh_arrays(shape: Shape) -> dict[str, Any]:
    """A mesh as the page takes it: vertices that corners share, in 16 bits but for `metres`."""
    low, high = shape.points.min(axis=(0, 1)), shape.points.max(axis=(0, 1))
    extent = np.maximum(high - low, 1e-9)
    hand = np.repeat(np.sign(shape.hand)[:, None, None], 3, axis=1)
    places = np.rint((shape.points - low) / extent * 65535.0)
    turned = np.concatenate((shape.tangents, hand), axis=-1)
    corners = np.concatenate(
        (places, np.rint(shape.normals * 32767.0), np.rint(turned * 32767.0)), axis=-1
    )
    rows = np.concatenate((corners, shape.metres.astype(np.float32)), axis=-1).reshape(-1, 12)
    single, number = np.unique(rows, axis=0, return_inverse=True)
    padded = np.zeros((len(single), 4))
    camera = shape.camera()
    subject = shape.subject

    def four(columns: NDArray[np.float64]) -> NDArray[np.float64]:
        out = padded.copy()
        out[:, : columns.shape[1]] = columns
        return out

    return {
        "places": array(four(single[:, :3]), "u2"), "normals": array(four(single[:, 3:6]), "i2"),
        "tangents": array(single[:, 6:10], "i2"), "metres": array(single[:, 10:], "f4"),
        "indices": array(number.reshape(-1), "u4"), "low": low.tolist(),
        "extent": extent.tolist(), "convex": shape.convex, "centre": subject.centre.tolist(),
        "radius": subject.radius, "towards": list(shape.towards),
        "distance": float(np.linalg.norm(camera.frame[:3, 3] - subject.centre)),
    }  # fmt: skip


def array(values: Any, kind: str) -> dict[str, str]:
    """An array as JSON: its type, and little-endian bytes in base64."""
    data = np.ascontiguousarray(values).astype(np.dtype(kind).newbyteorder("<"))
    return {"type": kind, "data": base64.b64encode(data.tobytes()).decode()}


def _filled(data: Any, title: str, about: str) -> str:
    """The page's text around its data."""
    modules = [(FOLDER / name).read_text() for name in ("viewer.js", "controls.js")]
    script = "\n".join(modules).replace("export ", "")
    style = (FOLDER / "page.css").read_text()
    # Only this style and this script may run, and nothing may be fetched.
    policy = (
        f"default-src 'none'; script-src '{_digest(script)}'; style-src '{_digest(style)}'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    text = (FOLDER / "page.html").read_text()
    parts = {
        "title": html.escape(title), "about": html.escape(about), "policy": policy, "style": style,
        "label": html.escape(f"{title} on a shape, lit from the side", quote=True),
        "data": json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"), "script": script,
    }  # fmt: skip
    # All at once: a part may hold what looks like the place of another.
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], text)


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
