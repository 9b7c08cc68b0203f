"""A coarse mesh with smooth normals: its own triangles leave no steps where light grazes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.chart import scenes
from fabricusd.reference.render import render_scene
from fabricusd.scene.scene import PreviewSurface, Scene


def profile(monkeypatch: pytest.MonkeyPatch, sides: int, smooth: bool = True) -> np.ndarray:
    """(96,) radiance across an upright cylinder, light nearly from the right."""
    monkeypatch.setattr(scenes, "SIDES", sides)
    mesh = scenes.cylinder()
    if not smooth:
        mesh = replace(mesh, normals=None, smooth=False)
    scene = Scene(
        meshes=[mesh],
        materials=[PreviewSurface(diffuse=(0.5, 0.5, 0.5), roughness=1.0)],
        lights=[scenes.sun((1.0, 0.0, 0.15), 2.0)],
        camera=scenes.facing(2 * scenes.RADIUS, 0.1 * scenes.RADIUS),
    )
    made = render_scene(scene, width=96, height=4, spp=64, max_bounces=0, pixel_filter="box")
    return made.layers["beauty"][..., :3].mean(axis=(0, 2))


def test_light_fades_where_the_smooth_surface_turns_away(monkeypatch):
    fine = profile(monkeypatch, 180)
    dim = (fine > 0.02 * fine.max()) & (fine < 0.3 * fine.max())
    assert dim.sum() > 8
    off = np.abs(profile(monkeypatch, 16) / np.maximum(fine, 1e-9) - 1.0)
    assert off[dim].max() < 0.15
    # The measure bites: facets fade in steps.
    facets = np.abs(profile(monkeypatch, 16, smooth=False) / np.maximum(fine, 1e-9) - 1.0)
    assert facets[dim].max() > 0.3
