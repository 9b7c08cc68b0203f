"""How near the lobes of single texels are to level `weave`, beside OpenPBR and the far mixture.

    python bench/materials/bench_near.py [PRESET ...]

A square of each preset is baked at 8, 16 and 40 texels a thread. Printed is the mean delta E 2000
of its texels over pairs of directions, in a light under which a white diffuser is white: against
level `weave` with its shadow, and against level `thread`, which also knows the place across a
thread. `lobes` are those of the texel, `afar` is the far mixture, and `openpbr` is OpenPBR with the
textures and its fit. `mean` is how far the mean of the texels is from the far mixture.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from fabricusd.appearance import surface
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.fabric import Binding
from fabricusd.images.files import read_mip_level
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.fit.fit import fit
from fabricusd.materials.fit.forward import forward, frames_of
from fabricusd.materials.fit.judge import hemisphere
from fabricusd.materials.fit.target import TexelSample
from fabricusd.materials.fit.texels import NEEDED, draw_texels
from fabricusd.materials.lobes.known import mixture_of
from fabricusd.materials.lobes.mixture import evaluate as evaluate_far
from fabricusd.materials.near.keep import moved_to, near_of
from fabricusd.materials.near.maps import texels_of, write_near_maps
from fabricusd.materials.near.mixture import evaluate
from fabricusd.materials.near.parts import Texels
from fabricusd.quality.colors import delta_e_2000
from fabricusd.schema import load, write_binding, write_fabric

PRESETS = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot", "velvet",
    "wool_flannel", "cotton_poplin",
)  # fmt: skip
SIZE, PER_THREAD, DRAWN = 512, (8.0, 16.0, 40.0), 400
VIEWS, LIGHTS = hemisphere(6, np.cos(np.radians(75.0))), hemisphere(20)


def baked(fabric, folder, threads):
    folder.mkdir()
    stage = Usd.Stage.CreateNew(str(folder / "square.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/World/Cloth")
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    mesh.CreatePointsAttr([(x, y, 0) for x, y in corners])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateExtentAttr([(0, 0, 0), (1, 1, 0)])
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    st.Set(corners)
    write_fabric(stage, "/World/Fabric", fabric)
    laid = Binding(fabric=fabric, threads_per_uv=(threads, threads))
    write_binding(mesh.GetPrim(), "/World/Fabric", laid)
    stage.GetRootLayer().Save()
    bake(folder / "square.usda", folder / "baked", Settings(resolution=SIZE))
    return read_bake_folder(folder / "baked").garments[0]


def sample_of(maps, rows):
    """Texels of the bake as OpenPBR reads them, one by one; the weave lies along the UVs."""
    read = {
        name: read_mip_level(next(iter(maps.textures[name].values())))
        .reshape(SIZE * SIZE, -1)[rows].astype(np.float64)
        for name in NEEDED
    }  # fmt: skip
    smooth = read["tangent"]
    return TexelSample(
        base=read["base_color"], smooth=read["roughness_along"][:, 0],
        rough=read["roughness_across"][:, 0], opacity=read["opacity"][:, 0],
        normal=read["normal"], tangent=np.stack((-smooth[:, 1], smooth[:, 0], smooth[:, 2]), 1),
        weight=np.full(len(rows), 1.0 / len(rows)),
    )  # fmt: skip


def chosen(texels, rows):
    return Texels(
        share=texels.share[rows], lean=texels.lean[rows], spread=texels.spread[rows],
        tint=texels.tint[rows],
    )  # fmt: skip


def figures(preset, per_thread, folder):
    fabric = load(preset)
    maps = baked(fabric, folder, SIZE / per_thread)
    files, parts = write_near_maps(maps, folder)
    near = moved_to(near_of(fabric, mixture_of(fabric)), parts[0])
    rows = np.random.default_rng(7).choice(SIZE * SIZE, DRAWN, replace=False)
    layers = {name: read_mip_level(next(iter(tiles.values()))) for name, tiles in files.items()}
    texels, openpbr = chosen(texels_of(layers), rows), sample_of(maps, rows)
    look = fit("openpbr", draw_texels(maps, 0, maps.lays[0]), fabric).look
    j, i = np.divmod(rows, SIZE)
    place = np.stack(((i + 0.5) / SIZE, 1.0 - (j + 0.5) / SIZE), axis=1)
    uv = place @ maps.lays[0].matrix.T + maps.lays[0].offset
    frames = frames_of(openpbr)
    off, means = {"weave": [], "thread": []}, ([], [])
    for wo in VIEWS:
        for light in LIGHTS:
            wi, views = np.tile(light, (DRAWN, 1)), np.tile(wo, (DRAWN, 1))
            mine, afar = evaluate(near, texels, wi, views), evaluate_far(near.far, wi, views)
            turned = [np.einsum("kab,kb->ka", frames, w)[:, None] for w in (wi, views)]
            other = forward("openpbr", look, openpbr, *turned)[:, 0]
            for level, found in off.items():
                true = surface.evaluate(fabric, wi, views, uv, level, "horizon")
                found.append([
                    delta_e_2000(np.pi * one, np.pi * true).mean() for one in (mine, afar, other)
                ])  # fmt: skip
            means[0].append(mine.mean(axis=0))
            means[1].append(afar[0])
    apart = delta_e_2000(np.pi * np.array(means[0]), np.pi * np.array(means[1])).mean()
    return [*np.mean(off["weave"], axis=0), *np.mean(off["thread"], axis=0), apart]


def main() -> None:
    print("| preset | texels a thread | weave: lobes | afar | openpbr | thread: lobes | afar | "
          "openpbr | mean |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for preset in sys.argv[1:] or PRESETS:
            for per_thread in PER_THREAD:
                folder = Path(name) / f"{preset}.{per_thread:g}"
                cells = [f"{x:.1f}" for x in figures(preset, per_thread, folder)]
                print("|", " | ".join((preset, f"{per_thread:g}", *cells)), "|", flush=True)


if __name__ == "__main__":
    main()
