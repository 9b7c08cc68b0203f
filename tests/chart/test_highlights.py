"""[Bisker2011] Figure 5.6: highlights on cylinders lie where the tangent curves say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.chart.highlights import dwells, found, predicted
from fabricusd.chart.scenes import RADIUS, facing, sun
from fabricusd.chart.sheets import cylinders, filament, wrap_degrees
from fabricusd.fabric import Fabric, TangentCurve, even
from fabricusd.geometry.nearest import published
from fabricusd.reference.render import render_scene
from fabricusd.scene.scene import Scene

SATIN, CREPE, LINEN = "polyester_satin_charmeuse", "silk_crepe_de_chine", "linen_plain"
NEAR = math.radians(1.5)
"""How far a highlight may lie from its place: less than the narrowest lobe's width, 2.5 degrees."""


def lit_from(degrees: float) -> np.ndarray:
    """A light over the viewer, so many degrees to the right."""
    a = math.radians(degrees)
    return np.array([math.sin(a), 0.3, math.cos(a)]) / math.hypot(1.0, 0.3)


def places(name: str, fabric: Fabric, wrap: str, to_light: np.ndarray) -> tuple[float, ...]:
    """Highlights in the path-traced picture of a cylinder, from the viewer's right to the left."""
    whole = cylinders(fabric, (wrap_degrees(name, wrap),))
    scene = Scene(
        meshes=whole.meshes, materials=whole.materials, lights=[sun(to_light, 2.5, 1.5)],
        camera=facing(2 * RADIUS, 2 * RADIUS),
    )  # fmt: skip
    made = render_scene(scene, width=240, height=8, spp=32, level="far", pixel_filter="box")
    return found(made.layers["beauty"][..., :3].mean(axis=(0, 2)), noise=1.0)


@pytest.mark.parametrize(("name", "count"), [(SATIN, 3), (CREPE, 2)])
@pytest.mark.parametrize("turn", [0, 20])
def test_highlights_round_the_cylinder_are_as_many_as_predicted_and_there(name, count, turn):
    fabric, to_light = even(published(name)), lit_from(turn)
    wanted = predicted(filament(name, fabric).curve, to_light)
    seen = places(name, fabric, "horizontal", to_light)
    assert len(wanted) == len(seen) == count
    assert np.abs(np.subtract(wanted, seen)).max() < NEAR


def test_another_curve_moves_them_and_the_old_prediction_fails():
    fabric = published(SATIN)
    thread = filament(SATIN, fabric)
    flatter = TangentCurve(
        positions=thread.curve.positions, angles=tuple(0.75 * a for a in thread.curve.angles)
    )
    changed = replace(
        fabric,
        threads={
            k: replace(t, curve=flatter) if t is thread else t for k, t in fabric.threads.items()
        },
    )
    seen = places(SATIN, changed, "horizontal", lit_from(0))
    assert np.abs(np.subtract(predicted(flatter, lit_from(0)), seen)).max() < NEAR
    assert np.abs(np.subtract(predicted(thread.curve, lit_from(0)), seen)).max() > 4 * NEAR


def test_threads_upright_or_without_a_dwell_make_one_broad_highlight():
    assert predicted(filament(LINEN, published(LINEN)).curve, lit_from(0)) == ()
    assert len(places(LINEN, published(LINEN), "horizontal", lit_from(0))) == 1
    seen = places(SATIN, published(SATIN), "vertical", lit_from(0))
    # The weft, which runs round, brightens the rims.
    assert len([p for p in seen if abs(p) < math.radians(60)]) == 1


def test_dwells_are_stretches_of_one_angle_not_jumps():
    curve = TangentCurve(positions=(0, 1, 1, 2, 3), angles=(0.1, 0.3, -0.2, -0.2, 0.0))
    assert dwells(curve) == (-0.2,)
