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

from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.appearance.weave.lookup import back_of
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.images import view
from fabricusd.preview.lights import Lights
from fabricusd.preview.page.arrays import mesh_arrays
from fabricusd.preview.page.tables import fabric_tables
from fabricusd.preview.page.threads import is_live, thread_controls
from fabricusd.preview.picture import BACKGROUND
from fabricusd.preview.shapes import SHAPES, Shape
from fabricusd.preview.sheet import words
from fabricusd.weaves.rows import from_cells as rows_of

FOLDER = Path(__file__).resolve().parent

ON_PAGE = ("cylinder", "sphere", "swatch", "drape")
"""Shapes that every page has."""

MOST_BYTES = 64 << 20
"""Bytes of the largest page: browsers parse more than that slowly, and mail servers refuse it."""

LEVEL = "auto"

SCRIPTS = (
    "sobol.js", "card.js", "viewer.js", "server.js", "state.js", "inputs.js", "camera.js",
    "cloth.js", "weave.js", "compare.js", "files.js", "main.js",
)  # fmt: skip
"""Parts of the page's script, one after the other: each may use those before it."""

MOST_DRAWN = 64
"""Ends and picks of the largest weave that the page has a grid of buttons for."""

POLICY = (
    "default-src 'none'; script-src {script}; style-src {style}; connect-src {connect}; "
    "img-src data: blob:; base-uri 'none'; form-action 'none'"
)
"""What a page may do: run its own script and style, and talk to the server it came from."""


def page(
    fabric: Fabric,
    *,
    lights: Lights = Lights(),  # noqa: B008
    mesh: Shape | None = None,
    title: str = "",
    reference: dict[str, Any] | None = None,
) -> str:
    """The page of `fabric`; mesh : the user's own, of which `metres` are those on the cloth.

    reference : a picture of its first view by the path tracer, as `serve.traced` makes it

    Raises FabricError for a fabric whose tables do not fit into a page.
    """
    data = page_data(fabric, lights, mesh)
    data["reference"] = reference
    made = _filled(data, title or fabric.name)
    if len(made) > MOST_BYTES:
        raise FabricError(
            fabric.name,
            f"would be a page of {len(made) >> 20} MB; it must be at most {MOST_BYTES >> 20} MB, "
            "which a smaller repeat or mesh gives",
        )
    return made


def page_data(fabric: Fabric, lights: Lights, mesh: Shape | None) -> dict[str, Any]:
    """Everything that the page's script begins with."""
    shapes = {} if mesh is None else {"scene": mesh}
    shapes.update({name: SHAPES[name](fabric) for name in ON_PAGE})
    back = side_data(back_of(fabric), back=True, live=fabric.back is None)
    return {
        "name": fabric.name, "level": LEVEL, "shaders": shaders(), "ground": BACKGROUND,
        "sides": {"front": side_data(fabric), "back": back},
        "meshes": {name: mesh_arrays(shape) for name, shape in shapes.items()},
        "light": {
            "azimuth": math.degrees(lights.azimuth), "elevation": math.degrees(lights.elevation),
            "key_power": lights.key, "even": lights.even, "slope": lights.slope,
        },
        "focal": 2.0 * 0.05 / 0.036,
    }  # fmt: skip


def side_data(fabric: Fabric, *, back: bool = False, live: bool = True) -> dict[str, Any]:
    """One side of a cloth as the page draws it; a back has no controls.

    live : whether the threads are those of the front, so that their numbers can be written here too
    """
    tables, rows = fabric_tables(fabric)
    even = " Threads are drawn even." if fabric.is_uneven else ""
    covered = coverage(fabric)
    ends, picks = fabric.weave.cells.shape
    return {
        "about": f"{words(fabric)}.{even}", "fabric": tables, "rows": rows,
        "live": live and is_live(fabric), "threads": [] if back else thread_controls(fabric),
        "weave": (
            "" if max(ends, picks) > MOST_DRAWN else "/".join(rows_of(fabric.weave.cells))
        ),
        "ends": ends, "picks": picks,
        "coverage": [float(covered.area[WARP]), float(covered.area[WEFT])],
        "density": [fabric.warp.density / 100.0, fabric.weft.density / 100.0],
    }  # fmt: skip


def shaders() -> dict[str, str]:
    """The shaders' texts by name."""
    read = {path.stem: path.read_text("utf-8") for path in FOLDER.glob("*.glsl")}
    kernels = read["kernels"] + read["cloth"]
    tone = read["tone"].replace("ACES_SCALE", repr(view._SCALE))
    return {
        "vertex": read["vertex"], "screen": read["screen"], "sum": read["sum"],
        "surface": kernels + read["sky"] + read["surface"],
        "display": tone + read["display"], "compare": tone + read["compare"],
    }  # fmt: skip


def shell() -> str:
    """The page's HTML for a server, which sends script, style and data separately."""
    parts = {
        "policy": "", "style": '<link rel="stylesheet" href="page.css">', "data": "",
        "script": '<script type="module" src="page.js"></script>', "title": "fabricusd preview",
    }  # fmt: skip
    text = _put((FOLDER / "page.html").read_text("utf-8"), parts)
    return text


def script() -> str:
    """The page's script."""
    return "\n".join((FOLDER / name).read_text("utf-8") for name in SCRIPTS).replace("export ", "")


def style() -> str:
    """The page's style."""
    return (FOLDER / "page.css").read_text("utf-8")


def _filled(data: Any, title: str) -> str:
    """The page's text around its data."""
    code, look = script(), style()
    # Only this style and this script may run, and nothing may be fetched.
    policy = POLICY.format(script=_digest(code), style=_digest(look), connect="'none'")
    held = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    parts = {
        "policy": f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        "title": html.escape(title), "style": f"<style>{look}</style>",
        "data": f'<script type="application/json" id="data">{held}</script>',
        "script": f'<script type="module">{code}</script>',
    }  # fmt: skip
    return _put((FOLDER / "page.html").read_text("utf-8"), parts)


def _put(text: str, parts: dict[str, str]) -> str:
    # All at once: a part may hold what looks like the place of another.
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], text)


def _digest(text: str) -> str:
    return "'sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() + "'"
