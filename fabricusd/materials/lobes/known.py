"""The mixtures of the presets, which need no fit, and those of other fabrics in the cache.

A row of the table is found by the radiance of the cloth for a few pairs of directions. A fabric
that was renamed, or whose attributes were changed without effect, is therefore known as well.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.cache import kept
from fabricusd.fabric import Fabric
from fabricusd.files import write_json
from fabricusd.materials.lobes.fit import COUNT, Fits, fits, refit
from fabricusd.materials.lobes.mixture import CYCLES, Lobe, Mixture
from fabricusd.materials.lobes.target import cloth, fitted_directions

Floats = NDArray[np.float64]
Progress = Callable[[str], None]

TABLE = Path(__file__).with_name("known.json")

PROBES = 48
"""Number of pairs of directions that a fabric is known by."""

ALIKE = 3e-3
"""Largest difference of two fabrics' radiance, over its mean, for them to be the same fabric: a
tenth of a delta E."""


def mixture_of(
    fabric: Fabric, count: int = COUNT, form: str = CYCLES, *,
    max_error: float | None = None, progress: Progress | None = None,
) -> Mixture:  # fmt: skip
    """Return the fitted mixture of `fabric`: from the table, from the cache, or from a fit.

    The arguments are those of `fit.fit`; `progress` gets a line if there is a fit to wait for.
    """
    if max_error is None:
        row = find(fabric)
        for one in row["mixtures"] if row else ():
            if one["form"] == form and _count(one) == count:
                return from_dict(one)

    say = progress or _nothing
    if form == CYCLES:
        return _fits(fabric, count, max_error, say).best

    def made() -> Mapping[str, Any]:
        begun = _fits(fabric, count, max_error, say)
        return asdict(refit(fabric, *(in_form(one, form) for one in begun)))

    return from_dict(_kept(fabric, (count, form, max_error), made))


def _fits(fabric: Fabric, count: int, max_error: float | None, say: Progress) -> Fits:
    """The fits of `fabric` in the form of Cycles, from the cache if they are there."""

    def made() -> Mapping[str, Any]:
        say(f"fitting {count} lobes to {fabric.name}")
        return {k: asdict(v) for k, v in fits(fabric, count, max_error=max_error)._asdict().items()}

    said = _kept(fabric, (count, CYCLES, max_error), made)
    return Fits(**{name: from_dict(one) for name, one in said.items()})


def _kept(
    fabric: Fabric, key: tuple[Any, ...], made: Callable[[], Mapping[str, Any]]
) -> Mapping[str, Any]:
    key = (_sources(), *key, np.round(probes(fabric), 6))
    found = kept("lobes", key, lambda: np.frombuffer(json.dumps(made()).encode(), np.uint8))
    return dict(json.loads(found.tobytes()))


def _nothing(_line: str) -> None:
    """Progress that nobody asked for."""


def find(fabric: Fabric) -> Mapping[str, Any] | None:
    """Return the row of the table for `fabric`, if there is one."""
    mine = probes(fabric)
    for row in _table():
        theirs = np.array(row["probes"])
        if np.abs(mine - theirs).max() <= ALIKE * max(float(np.abs(theirs).mean()), 1e-9):
            return row
    return None


def held(name: str, fabric: Fabric, count: int, form: str) -> list[Mixture]:
    """The mixtures of the table for a preset's name and law, be it still the same cloth or not."""
    rows = [one for one in _table() if (one["name"], one["law"]) == (name, fabric.surface_law)]
    found = [from_dict(one) for row in rows for one in row["mixtures"] if one["form"] == form]
    return [one for one in found if one.count == count]


def probes(fabric: Fabric) -> Floats:
    """(PROBES, 3) radiance of the cloth for pairs of directions spread over those of a fit."""
    wi, wo = fitted_directions()
    # A step that shares no factor with the number of lights goes through them all.
    chosen = (np.arange(PROBES) * 131) % (len(wi) // 2)
    return cloth(fabric, wi[chosen], wo[chosen])


def in_form(mixture: Mixture, form: str) -> Mixture:
    """Return the same numbers as a mixture in another form."""
    lobes = [replace(one, gaussian=one.gaussian and form == CYCLES) for one in mixture.lobes]
    return replace(mixture, form=form, lobes=tuple(lobes))


def from_dict(said: Mapping[str, Any]) -> Mixture:
    """Return a mixture that `dataclasses.asdict` took apart."""
    values: dict[str, Any] = _with_tuples(said)
    values["lobes"] = tuple(Lobe(**_with_tuples(one)) for one in said["lobes"])
    return Mixture(**values)


def _with_tuples(said: Mapping[str, Any]) -> dict[str, Any]:
    return {k: tuple(v) if isinstance(v, list) else v for k, v in said.items()}


def add_rows(rows: list[dict[str, Any]], path: Path = TABLE) -> None:
    """Write rows to the table, in place of those of the same names and laws."""
    mine = {(one["name"], one["law"]) for one in rows}
    others = read_rows(path) if path.exists() else []
    both = [one for one in others if (one["name"], one["law"]) not in mine] + rows
    write_json(path, {"rows": sorted(both, key=lambda one: (one["name"], one["law"]))})
    _table.cache_clear()


def read_rows(path: Path = TABLE) -> list[dict[str, Any]]:
    """Return the rows of the table."""
    return list(json.loads(path.read_text("utf-8"))["rows"])


def row_of(name: str, fabric: Fabric, mixtures: list[Mixture]) -> dict[str, Any]:
    """Return a row of the table, its numbers rounded to six digits."""
    row = {
        "name": name, "law": fabric.surface_law, "probes": probes(fabric).tolist(),
        "mixtures": [asdict(one) for one in mixtures],
    }  # fmt: skip
    return dict(_rounded(row))


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {k: _rounded(v) for k, v in value.items()}
    return [_rounded(v) for v in value] if isinstance(value, list | tuple) else value


def _count(held: Mapping[str, Any]) -> int:
    return sum(2 if one["paired"] else 1 for one in held["lobes"])


@lru_cache(maxsize=1)
def _table() -> list[dict[str, Any]]:
    return read_rows() if TABLE.exists() else []


@lru_cache(maxsize=1)
def _sources() -> str:
    """Digest of this folder's sources, on which a fit depends."""
    digest = hashlib.blake2b(digest_size=10)
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
