"""Lobes as nodes: Cycles renders what `lobes.mixture` says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from materials.lobes.mixtures import GAUSSIAN, LEVEL, PAIR, bare, mixture
from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.images.files import read_exr_layers
from fabricusd.materials.lobes.inputs import inputs
from fabricusd.materials.lobes.known import in_form
from fabricusd.materials.lobes.mixture import CYCLES, MATERIALX, evaluate, of_covered
from fabricusd.materials.lobes.network import lobes
from fabricusd.materials.networks.graph import Value, unrolled
from fabricusd.materials.networks.look import Look
from fabricusd.materials.networks.surfaces import preview
from fabricusd.materials.recipes import NEUTRAL
from fabricusd.materials.targets.write_usd import write_material
from tests.materials.targets.blender.addon.blender import in_blender

CELLS, SIDE = 8, 16
"""Squares along a side of the sheet, and pixels along a side of a square."""

TOWARDS = np.array((0.35, -0.2, 0.9)) / np.linalg.norm((0.35, -0.2, 0.9))
IRRADIANCE = 2.5

TURN = 0.4
MATRIX = np.diag((300.0, 240.0)) @ [
    [math.cos(TURN), math.sin(TURN)], [-math.sin(TURN), math.cos(TURN)]
]  # fmt: skip
"""From texture coordinates to threads: the weft lies at TURN to u."""

LEANING = replace(LEVEL, tilt=0.5, alpha_along=0.3)

DARK = (0.0, 0.0, 0.0)

CASES = {
    "whole": replace(mixture(CYCLES, PAIR, LEVEL, LEANING), sheen=DARK),
    "pair": bare(CYCLES, PAIR),
    "wide along": bare(CYCLES, replace(LEVEL, alpha_along=0.8, alpha_across=0.15)),
    "leaning": bare(CYCLES, LEANING),
    "gaussian": bare(CYCLES, GAUSSIAN),
    "of both": replace(mixture(CYCLES, GAUSSIAN, LEVEL), sheen=DARK),
    "wide gaussian": bare(
        CYCLES, replace(LEVEL, alpha_along=0.8, alpha_across=0.25, gaussian=True)
    ),
    "open": replace(mixture(CYCLES), sheen=DARK),
    "sheen": replace(
        mixture(CYCLES, replace(LEVEL, color=(1e-9,) * 3)), diffuse=DARK, sheen_roughness=0.9
    ),
}


def frames(seed=3):
    """(n, 3, 3) rows u, v, n of squares that the camera above sees, a quarter from behind."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < CELLS * CELLS:
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        # Steep squares would be narrower than a pixel.
        if abs(n[2]) < 0.25:
            continue
        n[2] = abs(n[2]) * (-1.0 if len(found) % 4 == 0 else 1.0)
        u = np.cross(rng.normal(size=3), n)
        u /= np.linalg.norm(u)
        found.append((u, np.cross(n, u), n))
    return np.array(found)


COVER = 0.6
"""Of the case "open"."""


def write_sheet(path, one, along, cover):
    """Squares, each with a frame of `along`, in a material of the mixture `one`."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/Sheet").GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/Sheet/Squares")
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    places = [(k % CELLS + 0.5, k // CELLS + 0.5, 0.0) for k in range(len(along))]
    points = [
        at + 0.35 * (x * u + y * v) for at, (u, v, _) in zip(places, along, strict=True)
        for x, y in corners
    ]  # fmt: skip
    mesh.CreatePointsAttr([tuple(map(float, p)) for p in points])
    mesh.CreateFaceVertexCountsAttr([4] * len(along))
    mesh.CreateFaceVertexIndicesAttr(list(range(4 * len(along))))
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    st.Set([tuple(0.5 + 0.35 * c) for _ in along for c in corners.astype(float)])
    maps = {**NEUTRAL, "opacity": Value("float", cover)}
    opaque = cover == 1.0
    surface = lobes(maps, opaque, in_form(one, MATERIALX), MATRIX)
    graphs = [("", preview(maps, Look(), opaque)), ("", unrolled(surface))]
    material = write_material(
        stage, Sdf.Path("/Sheet/Cloth"), graphs,
        inputs(of_covered(one, cover), "cloth", MATRIX), path.parent,
    )  # fmt: skip
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    stage.GetRootLayer().Save()


def expected(one, along):
    """(n, 3) radiance of each square."""
    sides = np.where(along[:, 2:, 2] < 0, -1.0, 1.0)
    n = sides * along[:, 2]
    axes = np.linalg.inv(MATRIX)
    axes = axes / np.linalg.norm(axes, axis=0)
    weft, warp = (axes[0, k] * along[:, 0] + axes[1, k] * along[:, 1] for k in (0, 1))
    frame = np.stack((weft, warp, n), axis=1)
    return IRRADIANCE * evaluate(one, frame @ TOWARDS, frame @ (0.0, 0.0, 1.0))


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Radiance that Cycles renders and that is expected, by the name of the case."""
    along, found = frames(), {}
    folder = tmp_path_factory.mktemp("lobes")
    steps = []
    for name, one in CASES.items():
        write_sheet(folder / f"{name}.usda", one, along, COVER if name == "open" else 1.0)
        steps += [
            {"do": "clear"}, {"do": "bring", "path": str(folder / f"{name}.usda")},
            {
                "do": "from_above", "picture": str(folder / f"{name}.exr"), "cells": CELLS,
                "towards_light": TOWARDS.tolist(), "irradiance": IRRADIANCE,
                "size": [CELLS * SIDE, CELLS * SIDE],
            },
        ]  # fmt: skip
    in_blender(folder, *steps)
    for name, one in CASES.items():
        pixels = read_exr_layers(folder / f"{name}.exr")[0]["beauty"][::-1]
        middle = SIDE // 2
        found[name] = pixels[middle::SIDE, middle::SIDE, :3].reshape(-1, 3), expected(one, along)
    return found


@pytest.mark.parametrize("name", [name for name in CASES if name != "sheen"])
def test_cycles_renders_what_the_formulas_say(rendered, name):
    ours, truth = rendered[name]
    lit = truth.max(axis=1) > 0.01 * truth.max()
    assert lit.sum() > 15
    assert np.abs(ours - truth)[~lit].max(initial=0.0) < 1e-3 * truth.max()
    assert np.abs(ours[lit] / truth[lit] - 1.0).max() < 1e-3


def test_sheen_differs_by_as_much_as_polynomials_do_from_the_table_of_cycles(rendered):
    ours, truth = rendered["sheen"]
    lit = truth.max(axis=1) > 0.01 * truth.max()
    ratio = ours[lit] / truth[lit]
    assert np.abs(ratio - 1.0).max() < 0.05
    assert ratio.mean() == pytest.approx(1.0, abs=0.02)
