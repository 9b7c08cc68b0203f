"""The tables that the translated kernels read, and where the page keeps each of them.

All reals lie one after the other in a texture of floats, all whole numbers in one of ints, the
horizons of places in one of bytes, and those of groups of places by fours. A table begins at
NAME_at and has NAME_n0 by NAME_n1 ... entries; these and the single numbers are in uniform blocks.
"""

from __future__ import annotations

from typing import Any

from fabricusd.appearance.shadow.mean import GROUPS
from fabricusd.preview.glsl.values import FLOAT, INT, Table, Value, constant

BYTE = "byte"

QUAD = "quad"
"""Four floats in a texel: horizons of groups of places, which are read one after the other. Their
NAME_at counts texels."""

TABLES: dict[str, tuple[int, str]] = {
    "published.threads": (2, FLOAT), "published.nodes": (2, FLOAT),
    "published.node_thread": (1, INT), "published.published": (1, INT),
    "published.wide_2": (1, FLOAT), "published.tall_2": (1, FLOAT),
    "published.means": (1, FLOAT), "published.excess": (1, FLOAT),
    "published.shares": (1, FLOAT),
    "conserving.threads": (2, FLOAT), "conserving.nodes": (2, FLOAT),
    "conserving.node_thread": (1, INT), "conserving.scatters": (1, INT),
    "conserving.sides": (4, FLOAT), "conserving.gap": (2, FLOAT),
    "conserving.strength": (2, FLOAT),
    "cloth.grid": (2, INT), "cloth.runs": (4, INT), "cloth.sequence": (2, INT),
    "cloth.width": (1, FLOAT), "cloth.rim": (1, FLOAT), "cloth.pitch": (1, FLOAT),
    "cloth.curve_start": (2, FLOAT), "cloth.curve_angle": (2, FLOAT),
    "cloth.curve_slope": (2, FLOAT), "cloth.pile": (1, INT),
    "shadow.table": (5, BYTE), "shadow.kinds": (2, INT), "shadow.mean": (1, QUAD),
    "shadow.piece_first": (2, INT), "shadow.piece_scale": (2, FLOAT),
    "shadow.absolute": (1, INT),
    "fuzz.phase": (3, FLOAT), "fuzz.lost": (1, FLOAT), "fuzz.up": (2, FLOAT),
    "fuzz.again": (2, FLOAT),
}  # fmt: skip
"""GROUP.FIELD -> (number of indices, kind)."""

NUMBERS: dict[str, str] = {
    "published.warp_start": INT, "published.gap": FLOAT, "published.precision": FLOAT,
    "published.columns": INT, "published.lit_rows": INT, "published.lit_nodes": INT,
    "published.share_columns": INT,
    "conserving.warp_start": INT, "conserving.covered": FLOAT,
    "conserving.opaque": INT, "cloth.gap": FLOAT, "cloth.last": FLOAT, "cloth.tiny": FLOAT,
    "shadow.softness": FLOAT, "shadow.mean_columns": INT, "shadow.set_stretches": INT,
    "shadow.groups": INT, "fuzz.depth": FLOAT,
}  # fmt: skip
"""GROUP.FIELD -> kind of each single number."""

HORIZON = 2
"""`Shadow.method` of the page: its shadows are those of the horizon table."""


def glsl_name(field: str) -> str:
    """GROUP.FIELD as GLSL spells it."""
    return field.replace(".", "_")


def fields() -> dict[Any, Value]:
    """`Translation.fields`."""
    found: dict[Any, Value] = {
        name: Value("", Table(glsl_name(name), *shape)) for name, shape in TABLES.items()
    }
    found.update({name: Value(glsl_name(name), kind) for name, kind in NUMBERS.items()})
    found["shadow.method"] = constant(HORIZON)
    # The page's tables have points for nodes: the mean of a lobe over a cell takes a compiler of
    # shaders half a minute.
    found["published_nodes", "3"] = constant(0.0)
    return found


def declarations() -> str:
    """The uniform blocks and the textures, with a name for everything in them."""
    lines = [
        "uniform sampler2D floats;",
        "uniform highp isampler2D ints;",
        "uniform highp usampler2D bytes;",
        "uniform sampler2D quads;",
        f"layout(std140) uniform Shapes {{ ivec4 shapes[{2 * len(TABLES)}]; }};",
        f"layout(std140) uniform Numbers {{ vec4 numbers[{len(NUMBERS)}]; }};",
        "float F(int k) { return texelFetch(floats, ivec2(k & 2047, k >> 11), 0).r; }",
        "int I(int k) { return texelFetch(ints, ivec2(k & 2047, k >> 11), 0).r; }",
        "int B(int k) { return int(texelFetch(bytes, ivec2(k & 2047, k >> 11), 0).r); }",
    ]
    lines += [
        "// `shadow.mean.mean_over`, by four groups at a time.",
        "float mean_of_groups(int at, int here, int beside, float c, float level) {",
        "  float total = 0.0;",
        f"  for (int k = 0; k < {GROUPS // 4}; ++k) {{",
        "    int i = at + (here >> 2) + k, j = at + (beside >> 2) + k;",
        "    vec4 a = texelFetch(quads, ivec2(i & 2047, i >> 11), 0);",
        "    vec4 b = texelFetch(quads, ivec2(j & 2047, j >> 11), 0);",
        "    vec4 t = clamp(level - (a + (b - a) * c), 0.0, 1.0);",
        "    total += dot(t * t * (3.0 - 2.0 * t), vec4(1.0));",
        "  }",
        f"  return total * {1.0 / GROUPS!r};",
        "}",
    ]
    for k, name in enumerate(TABLES):
        words = ("_at", "_n0", "_n1", "_n2", "_n3", "_n4")
        for word, place in zip(words[: TABLES[name][0] + 1], range(6), strict=False):
            member = f"shapes[{2 * k + place // 4}].{'xyzw'[place % 4]}"
            lines.append(f"#define {glsl_name(name)}{word} {member}")
    for k, (name, kind) in enumerate(NUMBERS.items()):
        code = f"numbers[{k}].x"
        lines.append(f"#define {glsl_name(name)} {f'int({code})' if kind == INT else code}")
    return "\n".join(lines) + "\n"
