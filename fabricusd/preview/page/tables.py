"""A fabric's tables as the page's shaders read them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.conserving.multiple import conserving_tables
from fabricusd.appearance.fuzz import optical_depth
from fabricusd.appearance.laws import REGISTRY, law_of
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering import columns as column
from fabricusd.appearance.scattering.models import any_conserving, any_published
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.surface import fuzz_of
from fabricusd.appearance.weave.compiled import compile_fabric, true_repeat
from fabricusd.appearance.weave.coverage import WARP, WEFT
from fabricusd.appearance.weave.quadrature import default_rule
from fabricusd.fabric import Fabric
from fabricusd.preview.glsl.tables import BYTE, NUMBERS, QUAD, TABLES
from fabricusd.preview.glsl.values import FLOAT, INT
from fabricusd.preview.page.arrays import array

REAL: Any = np.float32


def fabric_tables(fabric: Fabric) -> tuple[dict[str, Any], dict[str, Any]]:
    """(tables, where the page finds the threads' rows)."""
    groups = _groups(fabric)
    flat: dict[str, list[NDArray[Any]]] = {FLOAT: [], INT: [], BYTE: [], QUAD: []}
    used = dict.fromkeys(flat, 0)
    shapes = np.zeros((2 * len(TABLES), 4), np.int32)
    starts: dict[str, int] = {}
    for k, (name, (dimensions, kind)) in enumerate(TABLES.items()):
        found = _field(groups, name)
        values = np.zeros((0,) * dimensions) if found is None else np.asarray(found)
        starts[name] = used[kind]
        if name == "shadow.mean" and groups["shadow"].all_absolute:
            # It is not read, and would be half of what the page loads.
            values = np.zeros(0)
        row = [used[kind] // (4 if kind == QUAD else 1), *values.shape]
        shapes[2 * k : 2 * k + 2].reshape(-1)[: len(row)] = row
        flat[kind].append(values.reshape(-1))
        used[kind] += values.size
    numbers = np.zeros((len(NUMBERS), 4), np.float32)
    for k, name in enumerate(NUMBERS):
        numbers[k, 0] = _field(groups, name) or 0
    kinds = {
        FLOAT: ("floats", "f4"), INT: ("ints", "i4"), BYTE: ("bytes", "u1"), QUAD: ("quads", "f4")
    }  # fmt: skip
    arrays = {name: array(np.concatenate(flat[kind]), code) for kind, (name, code) in kinds.items()}
    lengths = groups["cloth"].sequence_length
    tables = {
        **arrays, "shapes": array(shapes, "i4"), "numbers": array(numbers, "f4"),
        "defines": _defines(fabric),
        "repeats": [int(lengths[WARP]), int(lengths[WEFT]), len(fabric.threads), 0],
        "density": [fabric.warp.density, fabric.weft.density],
        "repeat": [int(n) for n in true_repeat(fabric)],
    }  # fmt: skip
    rows = {
        "start": starts["published.threads"], "width": column.COLUMNS,
        "columns": {
            "albedo": column.ALBEDO_R, "ior": column.IOR_EXCESS, "isotropic": column.ISOTROPIC,
            "gamma": column.GAMMA_SURFACE, "lobes": column.SURFACE_LOBE,
        },
    }  # fmt: skip
    return tables, rows


def _groups(fabric: Fabric) -> dict[str, Any]:
    """The tables by the names of `glsl.tables`; None for those that the fabric has not."""
    shadow = compile_shadow(fabric, "horizon", precision=REAL)
    return {
        "published": surface_tables(
            fabric, precision=REAL, rule=default_rule(fabric, cells=False),
            shadow=shadow if law_of(fabric).absolute else None,
        ),
        "conserving": conserving_tables(fabric, precision=REAL) if any_conserving(fabric) else None,
        "cloth": compile_fabric(fabric, precision=REAL),
        "shadow": shadow,
        "fuzz": fuzz_of(fabric, REAL),
    }  # fmt: skip


def _field(groups: dict[str, Any], name: str) -> Any:
    """GROUP.FIELD, or None where the fabric has no such table."""
    group, _, field = name.partition(".")
    return getattr(groups[group], field, None)


def _defines(fabric: Fabric) -> dict[str, Any]:
    """The macros that choose what of the shaders a fabric needs."""
    laws = {law: name for name, law in REGISTRY.items()}
    return {
        "LAW": laws[law_of(fabric)].upper(), "PUBLISHED": int(any_published(fabric)),
        "FACETS": int(any_conserving(fabric)), "FUZZ": int(optical_depth(fabric) > 0),
    }  # fmt: skip
