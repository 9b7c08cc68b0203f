"""How near lobes are to the cloth on a drape under many suns, and not under one alone.

    python bench/materials/lobes_suns.py [NAME ...]

The drape of `samples` is seen as `blender_compare.py` sees it. Each of its triangles counts by the
area that it shows to the camera, as if nothing hid it, and is lit by 24 distant lights in turn, all
on the camera's side and above the table. The value is that of the formulas, which Cycles renders
within .1 % (`tests/materials/targets/blender`). The table gives delta E 2000 from level `far`: its
mean over the suns, the range from the best sun to the worst, and the mean over the folds alone. The
table's flat top is one pair of directions under each sun, and a seventh of what is seen.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "samples"))
from blender_compare import GARMENT
from make_samples import make_drape

from fabricusd.materials.lobes.__main__ import PUBLISHED
from fabricusd.materials.lobes.known import mixture_of
from fabricusd.materials.lobes.mixture import FORMS, evaluate
from fabricusd.materials.lobes.target import cloth
from fabricusd.quality.colors import delta_e_2000
from fabricusd.schema import load

EYE, AT = np.array(GARMENT.eye), np.array(GARMENT.at)
SUNS = 24
LEVEL = 0.98
"""Upward part of the normal from which on a triangle is of the table's top."""

GRAZING = 0.02
"""Cosine of the view below which a triangle is left out."""


class Drape:
    """Triangles of the drape, as frames (n, 3, 3) of weft, warp and normal, and shares of the
    picture (n,)."""

    def __init__(self, folder: Path) -> None:
        make_drape(folder)
        stage = Usd.Stage.Open(str(folder / "drape.usda"))
        meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
        mesh = max(meshes, key=lambda one: len(one.GetPointsAttr().Get()))
        world = np.array(UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(0))
        points = np.array(mesh.GetPointsAttr().Get(), float) @ world[:3, :3] + world[3, :3]
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get())
        corners = corners.reshape(len(mesh.GetFaceVertexCountsAttr().Get()), -1)
        st = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").ComputeFlattened())
        st = st.reshape(*corners.shape, 2) if len(st) == corners.size else st[corners]
        a, b, c = (points[corners[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        area = np.linalg.norm(normal, axis=1)
        normal /= area[:, None]
        (du, dv), (eu, ev) = (st[:, 1] - st[:, 0]).T, (st[:, 2] - st[:, 0]).T
        along = (ev[:, None] * (b - a) - dv[:, None] * (c - a)) / (du * ev - eu * dv)[:, None]
        along -= normal * (along * normal).sum(axis=1, keepdims=True)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        self.frames = np.stack((along, np.cross(normal, along), normal), axis=1)
        towards = EYE - points[corners].mean(axis=1)
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        seen = np.einsum("nij,nj->ni", self.frames, towards)
        # The back of the cloth is its front, turned over about the weft.
        self.side = np.where(seen[:, 2] < 0.0, -1.0, 1.0)
        self.wo = self._turned(seen)
        self.share = area * self.wo[:, 2]
        self.top = np.abs(normal[:, 1]) > LEVEL

    def _turned(self, w: np.ndarray) -> np.ndarray:
        return np.column_stack((w[:, 0], w[:, 1] * self.side, w[:, 2] * self.side))

    def towards(self, sun: np.ndarray) -> np.ndarray:
        """(n, 3) the sun's direction in each frame."""
        return self._turned(self.frames @ sun)


def suns() -> np.ndarray:
    """(SUNS, 3) directions on the camera's side and above the table."""
    generator, found = np.random.default_rng(1), []
    while len(found) < SUNS:
        w = generator.normal(size=3)
        w /= np.linalg.norm(w)
        if w @ (EYE - AT) > 0.0 and w[1] > 0.1:
            found.append(w)
    return np.array(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME")
    names = parser.parse_args().names or PUBLISHED
    with tempfile.TemporaryDirectory() as folder:
        drape = Drape(Path(folder))
    print("| preset | law | form | delta E | best to worst sun | folds |")
    print("|---|---|---|---|---|---|", flush=True)
    for name in names:
        fabric = load(name)
        for form in FORMS:
            mixture = mixture_of(fabric, 4, form)
            every: list[float] = []
            folds: list[float] = []
            for sun in suns():
                wi = drape.towards(sun)
                lit = (wi[:, 2] > 0.0) & (drape.wo[:, 2] > GRAZING)
                pair = wi[lit], drape.wo[lit]
                off = delta_e_2000(np.pi * evaluate(mixture, *pair), np.pi * cloth(fabric, *pair))
                for found, share in (
                    (every, drape.share[lit]), (folds, drape.share[lit] * ~drape.top[lit])
                ):  # fmt: skip
                    found.append(float(share @ off / share.sum()))
            print(
                f"| {name} | {fabric.surface_law} | {form} | {np.mean(every):.2f} | "
                f"{min(every):.2f} to {max(every):.2f} | {np.mean(folds):.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
