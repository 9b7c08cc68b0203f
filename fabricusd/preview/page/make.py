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

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.images import view
from fabricusd.preview.lights import Lights
from fabricusd.preview.page.arrays import mesh_arrays
from fabricusd.preview.page.tables import fabric_tables, thread_controls
from fabricusd.preview.picture import BACKGROUND
from fabricusd.preview.shapes import SHAPES, Shape
from fabricusd.preview.sheet import words

FOLDER = Path(__file__).resolve().parent

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
