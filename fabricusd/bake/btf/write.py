"""Write the requested forms of a fabric's BTF to a folder, with the error and size of each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.btf.factored import (
    FactoredBtf,
    factored,
    read_atlas,
    read_factored,
    write_atlas,
    write_factored,
)
from fabricusd.bake.btf.factors import Factors, factors
from fabricusd.bake.btf.matrix import Btf, btf_of
from fabricusd.bake.btf.ubo import read_ubo, write_ubo
from fabricusd.bake.error.accuracy import PAIRS, bound_of, display, pairs_between
from fabricusd.bake.texels.law_values import LawAtPlaces
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.quality.colors import delta_e_2000

Floats = NDArray[np.float64]

MARGIN = 1.5
"""Ratio of the stated bound to the largest measured mean, between a table's directions."""

FORMS = ("ubo", "ubo-joint", "factored", "atlas")

PER_THREAD = 16
"""Texels along a thread's pitch."""

MAX_ERROR = 1.0
"""Default bound on the mean delta E 2000, for which the rank is chosen: just noticeable."""


def write_btf(
    fabric: Fabric,
    folder: Path,
    forms: Sequence[str],
    *,
    max_error: float = MAX_ERROR,
    per_thread: int = PER_THREAD,
    directions: Floats | None = None,
) -> list[dict[str, Any]]:
    """Write `forms` of the BTF of one repeat; return a record of each, for JSON.

    directions : (d, 3) of light and of view; None for the default 151

    In a record, `delta_e` is the error of the factors for the table's own directions.
    `delta_e_between` is the error between these directions, where a reader has to interpolate; it
    does not fall with the rank, and is measured on the files as they are read back. `bound` is 1.5
    times the error of the worst pair of directions.
    """
    unknown = [f for f in forms if f not in FORMS]
    if unknown:
        raise FabricError(
            f"--btf '{unknown[0]}'", f"is unknown; it must be one of {', '.join(FORMS)}"
        )
    btf = btf_of(fabric, per_thread=per_thread, directions=directions)
    stem = folder / fabric.name
    records: list[dict[str, Any]] = []
    for form in FORMS:
        if form not in forms:
            continue
        made = factors(btf, joint=form != "ubo", max_error=max_error)
        files = _written(form, stem, btf, made)
        records.append(
            {
                "form": form,
                "files": [f.name for f in files],
                "megabytes": sum(f.stat().st_size for f in files) / 1e6,
                "rank": [c.shape[1] for c in made.columns],
                "delta_e": made.delta_e,
            }
        )
    apart = between(fabric, [read_form(r["form"], stem, per_thread) for r in records])
    for record, errors in zip(records, apart, strict=True):
        record |= {
            "delta_e_between": float(errors.mean()),
            "bound": bound_of(float(errors.max()), MARGIN),
        }
    return records


def _written(form: str, stem: Path, btf: Btf, made: Factors) -> list[Path]:
    """Write one form and return its files."""
    if form == "atlas":
        return list(write_atlas(stem, factored(btf, made)))
    path = _path(form, stem)
    if form == "factored":
        write_factored(path, factored(btf, made))
    else:
        write_ubo(path, btf, made)
    return [path]


def _path(form: str, stem: Path) -> Path:
    ends = {"ubo": ".btf", "ubo-joint": ".joint.btf", "factored": ".factored.npz"}
    return Path(f"{stem}{ends[form]}")


def read_form(form: str, stem: Path, per_thread: int = PER_THREAD) -> FactoredBtf:
    """Read `form` of a fabric's BTF, as `write_btf` wrote it.

    stem : the path of the files without their suffixes; its name is the fabric's
    per_thread : texels along a thread's pitch, which `.btf` files do not hold
    """
    if form == "atlas":
        return read_atlas(stem)
    path = _path(form, stem)
    if form == "factored":
        return read_factored(path)
    one = read_ubo(path)
    return FactoredBtf(
        directions=one.directions, factors=one.factors, size=one.size, per_thread=per_thread
    )


def between(
    fabric: Fabric, forms: Sequence[FactoredBtf], pairs: tuple[Floats, Floats] | None = None
) -> Floats:
    """(forms, pairs) mean delta E 2000 against level `weave`, between the tables' directions.

    pairs : (n, 3) wi and wo; None for `accuracy.PAIRS` default pairs
    """
    weave = np.random.default_rng(1).random((512, 2)) * 64.0
    cloth = LawAtPlaces(fabric, weave)
    found = []
    for wi, wo in zip(*(pairs or pairs_between(PAIRS)), strict=True):
        true = cloth.values(wi, wo)
        got = np.stack([one.evaluate(weave, wi, wo) for one in forms])
        shown = np.broadcast_to(display(true, wi), got.shape)
        found.append(delta_e_2000(display(got, wi), shown).mean(axis=1))
    return np.stack(found, axis=1)
