"""The colour of cloth by routes that share nothing with the solver of `fabricusd.dye`.

`by_quadrature` integrates `surface.evaluate`, the law that is rendered, over both hemispheres.
`by_tracing` renders a stack of layers in a uniform sky.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.stats import qmc

from fabricusd.appearance import surface
from fabricusd.appearance.conserving.by_side import by_side
from fabricusd.fabric import Binding
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, PreviewSurface, Scene

VIEW = math.radians(8.0)
BLACK = PreviewSurface(diffuse=(0.0, 0.0, 0.0), ior=1.0)


def shares(fabric, logarithm: int = 14, seed: int = 1):
    """(2, 2, 3) R and T of one layer, for a view at 8 degrees and in diffuse light, per channel."""
    u = qmc.Sobol(4, seed=seed).random_base2(logarithm)
    phi = 2 * math.pi * u[:, 1]
    sine = np.sqrt(u[:, 0])
    diffuse = np.stack((sine * np.cos(phi), sine * np.sin(phi), np.sqrt(1 - u[:, 0])), axis=1)
    tilted = np.stack(
        (
            math.sin(VIEW) * np.cos(phi),
            math.sin(VIEW) * np.sin(phi),
            np.full(len(u), math.cos(VIEW)),
        ),
        axis=1,
    )
    # Light from everywhere above or below, drawn by the cosine.
    around, rise = 2 * math.pi * u[:, 3], np.sqrt(1 - u[:, 2])
    flat = np.sqrt(u[:, 2])
    above = np.stack((flat * np.cos(around), flat * np.sin(around), rise), axis=1)
    found = np.empty((2, 2, 3))
    for row, wo in enumerate((tilted, diffuse)):
        polar = np.arccos(wo[:, 2])
        gap = float(by_side(fabric, polar, phi).gap.mean())
        for side, sign in enumerate((1.0, -1.0)):
            wi = above * (1.0, 1.0, sign)
            value = surface.evaluate(fabric, wi, wo) * (math.pi / rise)[:, None]
            found[row, side] = value.mean(axis=0)
        found[row, 1] += gap
    return found


def stacked(shares):
    """(3,) reflectance of layers that are added until nothing changes, one after another."""
    (r_view, t_view), (r, t) = shares
    below = np.zeros(3)
    for _ in range(100_000):
        more = r + t * t * below / (1 - r * below)
        if np.abs(more - below).max() < 1e-9:
            break
        below = more
    return r_view + t_view * t * below / (1 - r * below)


def added(shares, layers: int):
    """(3,) reflectance of that many layers over black."""
    (r_view, t_view), (r, t) = shares
    below = np.zeros(3)
    for _ in range(layers - 1):
        below = r + t * t * below / (1 - r * below)
    return r_view + t_view * t * below / (1 - r * below)


def traced(fabric, size: int = 16, samples: int = 256, bounces: int = 64):
    """(colour (3,), its standard error, what is left out) of a stack in a white sky.

    The stack has so many layers that adding says that less than .001 is left out. What the bounces
    leave out is what the last quarter of them adds, which falls geometrically.
    """
    single = shares(fabric, 13)
    layers = next(
        (n for n in range(2, 200) if np.abs(stacked(single) - added(single, n)).max() < 1e-3), 200
    )
    eye = 3.0 * np.array([0.0, math.cos(VIEW), math.sin(VIEW)])
    frame = np.eye(4)
    frame[:3, 1] = (0.0, math.sin(VIEW), -math.cos(VIEW))
    frame[:3, 2] = eye / 3.0
    frame[:3, 3] = eye
    camera = Camera(frame=frame, orthographic=True, aperture=(0.01, 0.01))
    square = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) * 50.0
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    sheets = [
        Mesh(
            path=f"sheet{k}",
            points=square - np.array([0.0, 1e-3 * k, 0.0]),
            triangles=triangles,
            uv=square[:, [0, 2]][triangles],
            material=np.zeros(2, int),
        )
        for k in range(layers)
    ]
    # The sky is below too, and a stack transmits more than it lacks in reflectance.
    floor = replace(
        sheets[0], path="floor", points=square - [0.0, 1e-3 * layers, 0.0],
        material=np.ones(2, int),
    )  # fmt: skip
    scene = Scene(
        meshes=[*sheets, floor],
        materials=[FabricSurface(binding=Binding(fabric=fabric, metres_per_uv=1.0)), BLACK],
        lights=[Light(path="sky", kind=DOME, radiance=(1.0, 1.0, 1.0))],
        camera=camera,
    )

    def seen(most):
        made = render_scene(
            scene, width=size, height=size, spp=samples, max_bounces=most, max_translucent=most,
            level="far", shadow="none",
        )  # fmt: skip
        return np.asarray(made.layers["beauty"][..., :3], np.float64).reshape(-1, 3)

    whole, less = seen(bounces), seen(3 * bounces // 4)
    mean = whole.mean(axis=0)
    error = float((whole.std(axis=0) / math.sqrt(len(whole))).max())
    left = np.abs(stacked(single) - added(single, layers)).max()
    return mean, error, float(left + np.abs(mean - less.mean(axis=0)).max())
