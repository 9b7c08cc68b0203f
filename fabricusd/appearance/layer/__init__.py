"""What one layer of `conserving` cloth does with light: reflectance and transmittance, as sums that
are known for every albedo of its threads.

Of woven cloth in plain NumPy, so that authoring compiles no kernels.
"""

from __future__ import annotations

from dataclasses import replace

from fabricusd.appearance.layer.fuzz import fuzzed
from fabricusd.appearance.layer.layer import Layer, alone
from fabricusd.appearance.layer.woven import woven_layer
from fabricusd.fabric import PILE_ANGLE, Fabric

__all__ = ["Layer", "alone", "layer_of"]


def layer_of(fabric: Fabric) -> Layer:
    """One layer of `fabric`, of which threads of other models count as black, as in its law."""
    if any(t.curve.steepest > PILE_ANGLE for t in fabric.thread_list):
        # Tracing pile compiles kernels.
        from fabricusd.appearance.layer.pile import pile_layer

        layer = pile_layer(fabric)
    else:
        layer = woven_layer(fabric)
    return replace(layer, fuzz=fuzzed(fabric))
