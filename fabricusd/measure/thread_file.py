"""A fitted thread as a USD layer: a plain swatch of it, as the single threads among the presets."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fabricusd.fabric import FACETS, SURFACE_LAWS, Fabric, ThreadSet, Weave
from fabricusd.measure.fit.result import Fitted
from fabricusd.measure.lobes import Lobes, described

SWATCH = ThreadSet(density=4500.0, coverage=0.45)
"""Threads per metre and coverage of the swatch, as the presets of single threads have them."""


def best_of(fits: Sequence[Fitted]) -> Fitted:
    """The fit with the least chi^2; of equals, the first."""
    return min(fits, key=lambda fit: fit.chi2)


def swatch(lobes: Lobes, fit: Fitted, source: str) -> Fabric:
    """Plain weave of the fitted thread; only the thread is measured, and its documentation says
    how. `source` : where the lobes are from."""
    said = [
        f"Fitted by fabricusd to {source}: {described(lobes)}.",
        *fit.lines(),
        *(f"note: {note}" for note in lobes.notes),
    ]
    thread = replace(fit.thread, documentation="\n".join(line.strip() for line in said))
    law = FACETS if fit.model == "conserving" else SURFACE_LAWS[0]
    return Fabric(
        name=lobes.name,
        threads={"Thread": thread},
        weave=Weave(np.eye(2, dtype=bool), "plain"),
        warp=SWATCH,
        weft=SWATCH,
        model=fit.model,
        surface_law=law,
        documentation="A plain-weave swatch of one measured thread. Only the thread is measured; "
        "the weave around it is a way to look at it.",
    )


def save_thread(
    lobes: Lobes, fit: Fitted, path: str | os.PathLike[str], *, source: str, clobber: bool = True
) -> None:
    """Write the swatch as a layer, whole or not at all."""
    from fabricusd.schema.write import save

    save(swatch(lobes, fit, source), path, clobber=clobber)
