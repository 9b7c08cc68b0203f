"""One layer of pile, for which no shares by side are known: kernels trace its facets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.conserving.facets import SURFACE, VOLUME, white_facets
from fabricusd.appearance.conserving.grid import entry_angles, mean_share
from fabricusd.appearance.layer.fuzz import VIEW
from fabricusd.appearance.layer.layer import Layer, mean_surface
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.fabric import CONSERVING_MODEL, Fabric

Floats = NDArray[np.float64]


def pile_layer(fabric: Fabric) -> Layer:
    """As `woven.woven_layer`, from the factors of 1 that `conserving.multiple` has for pile.

    The light that several threads scatter inside is shared between them by their areas.
    """
    facets = white_facets(fabric)
    sent = facets.sent[..., 0].astype(np.float64).reshape(*facets.shape, 2, 2)
    if fabric.opaque:
        sent[:, :, 1] = 0.0
    theta = entry_angles(*facets.shape)[0][:, 0]

    def rows(values: Floats) -> Floats:
        return np.array([np.interp(VIEW, theta, values.mean(axis=1)), mean_share(values)])

    gap = float(coverage(fabric).gap)
    once = sent.sum(axis=3)
    rest = np.maximum(1.0 - gap - once.sum(axis=2), 0.0)
    own, other = (mean_share(once[:, :, side]) for side in range(2))
    forward = other / (own + other) if own + other > 0 else 0.0
    area = coverage(fabric).type_area.sum(axis=0)
    mean = np.array(
        [
            float(share) / float(area.sum()) * (fabric.model_of(t) == CONSERVING_MODEL)
            for share, t in zip(area, fabric.thread_list, strict=True)
        ]
    )
    term = {
        (side, which): rows(sent[:, :, side, which])
        for side in range(2)
        for which in (SURFACE, VOLUME)
    }
    return Layer(
        surface=np.stack([term[side, SURFACE] for side in range(2)], axis=1),
        volume=np.stack([term[side, VOLUME] for side in range(2)], axis=1)[..., None] * mean,
        rest=rows(rest)[:, None] * np.array([1.0 - forward, forward]),
        gap=np.full(2, 0.0 if fabric.opaque else gap),
        escape=float(1.0 - mean_share(rest) / max(1.0 - gap, 1e-300)),
        mean=mean,
        bright=np.array([mean_surface(t) for t in fabric.thread_list]),
    )
