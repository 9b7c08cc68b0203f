"""Every form that was asked for of a fabric, into a folder, with what each reached and costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.appearance.surface import evaluate
from fabricusd.bake.accuracy import delta_e, display, pairs_between
from fabricusd.bake.btf.factored import FactoredBtf, factored, write_atlas, write_factored
from fabricusd.bake.btf.factors import factors
from fabricusd.bake.btf.matrix import btf_of
from fabricusd.bake.btf.ubo import write_ubo
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

FORMS = ("ubo", "ubo-joint", "factored", "atlas")

MAX_ERROR = 1.0
"""Mean delta E 2000 that the rank is chosen for where nothing is asked: just noticeable."""


def write_btf(
    fabric: Fabric,
    folder: Path,
    forms: Sequence[str],
    *,
    max_error: float = MAX_ERROR,
    per_thread: int = 16,
) -> list[dict[str, Any]]:
    """Write `forms` of the BTF of one repeat; a record of each, for JSON.

    delta_e is that of the factors on the table's own directions; between them, where a reader has
    to interpolate, it is `delta_e_between`, which no rank makes smaller.
    """
    unknown = [f for f in forms if f not in FORMS]
    if unknown:
        raise FabricError(f"--btf '{unknown[0]}'", f"is unknown; it must be {', '.join(FORMS)}")
    btf = btf_of(fabric, per_thread=per_thread)
    records = []
    for form in FORMS:
        if form not in forms:
            continue
        made = factors(btf, joint=form != "ubo", max_error=max_error)
        one = factored(btf, made)
        stem = folder / fabric.name
        if form in ("ubo", "ubo-joint"):
            files = [Path(f"{stem}{'.joint' if form == 'ubo-joint' else ''}.btf")]
            write_ubo(files[0], btf, made)
        elif form == "factored":
            files = [Path(f"{stem}.factored.npz")]
            write_factored(files[0], one)
        else:
            files = list(write_atlas(stem, one))
        records.append(
            {
                "form": form,
                "files": [f.name for f in files],
                "megabytes": sum(f.stat().st_size for f in files) / 1e6,
                "rank": [c.shape[1] for c in made.columns],
                "delta_e": made.delta_e,
                "delta_e_between": between(fabric, one),
            }
        )
    return records


def between(fabric: Fabric, one: FactoredBtf, count: int = 8) -> float:
    """Mean delta E 2000 against level `weave` at places and directions of no table."""
    rng = np.random.default_rng(1)
    weave = rng.random((512, 2)) * 64.0
    found = []
    for wi, wo in zip(*pairs_between(count), strict=True):
        true = evaluate(fabric, np.repeat(wi[None], len(weave), axis=0), wo, weave, "weave")
        got = one.evaluate(weave, wi, wo)
        found.append(float(delta_e(display(got, wi), display(true, wi)).mean()))
    return float(np.mean(found))
