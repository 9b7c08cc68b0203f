"""Make the sample scenes: cylinders in three orientations, a draped cloth, a skirt on a figure.

    python samples/make_samples.py [FOLDER]

Writes `cylinders.usda`, `drape.usda` and `skirt.usda`, and the scenes of `lit_from_behind`. Lengths
are in metres, +y is up. Everything is computed here; no file is read.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from cloth_simulation import drum_body, simulate, turned_body
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt
from scipy.ndimage import gaussian_filter, zoom

from fabricusd.fabric import Binding, Fabric
from fabricusd.materials.uniform import Looks, fitted_looks, write_fabric_material
from fabricusd.schema import load, write_fabric

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of points as quads, with UVs in metres; `around` closes its first axis.

    cuts : columns of UVs that end at a seam; the next column has the same points again
    """

    points: Points
    uv: NDArray[np.float64]
    around: bool = False
    cuts: tuple[int, ...] = ()


def define_grid(stage: Usd.Stage, path: str, grid: Grid) -> UsdGeom.Mesh:
    """Define a mesh of quads; its normals are the cross product of first and second axis."""
    m, n = grid.points.shape[:2]
    i = np.arange(m * n).reshape(m, n)
    # In a closed grid, the seam has two columns of UVs, so there is one more than of points.
    columns = grid.uv.shape[0]
    j = np.arange(columns * n).reshape(columns, n)
    ring = np.concatenate([i, i[:1]]) if grid.around else i
    faces = _quads(ring)
    strips = _quads(j).reshape(columns - 1, n - 1, 4)
    corners = np.delete(strips, grid.cuts, axis=0).reshape(-1, 4)
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(grid.points.reshape(-1, 3).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 4, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel().astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr("none")
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    primvar.Set(Vt.Vec2fArray.FromNumpy(grid.uv.reshape(-1, 2).astype(np.float32)))
    primvar.SetIndices(Vt.IntArray.FromNumpy(corners.ravel().astype(np.int32)))
    low, high = grid.points.reshape(-1, 3).min(axis=0), grid.points.reshape(-1, 3).max(axis=0)
    mesh.CreateExtentAttr([Gf.Vec3f(*low.tolist()), Gf.Vec3f(*high.tolist())])
    return mesh


def _quads(i: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)


def finer(points: Points, factor: int, *, around: bool = False) -> Points:
    """A grid whose cells are divided into `factor` by `factor`, by cubic splines."""
    m = points.shape[0]
    if around:
        # Periodic: pad by whole columns, refine, and remove the padding again.
        pad = 6
        points = np.concatenate([points[-pad:], points, points[: pad + 1]])
    fine = np.stack(
        [
            zoom(points[..., k], [((s - 1) * factor + 1) / s for s in points.shape[:2]], order=3)
            for k in range(points.shape[2])
        ],
        axis=-1,
    )
    return fine[pad * factor : (pad + m) * factor] if around else fine


def new_scene(path: Path, *, sky: float = 0.55, lamps: bool = True) -> Usd.Stage:
    """A stage in metres with a floor, a soft sky, a key light and a rim light for look-dev.

    sky : intensity of the dome; lamps : whether there are a key and a rim light
    """
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    grey(stage, "/World/Looks/Floor", (0.32, 0.31, 0.30), 0.9)
    floor = define_grid(stage, "/World/Floor", Grid(*_backdrop()))
    bind(stage, floor, "/World/Looks/Floor")
    dome = UsdLux.DomeLight.Define(stage, "/World/Lights/Sky")
    dome.CreateIntensityAttr(sky)
    dome.CreateColorAttr((0.92, 0.97, 1.0))
    if lamps:
        rect_light(stage, "Key", (-1.6, 2.4, 1.8), 1.0, 34.0, 5200.0)
        rect_light(stage, "Rim", (1.9, 1.9, -1.5), 0.8, 26.0, 6500.0)
    return stage


def _backdrop() -> tuple[Points, NDArray[np.float64]]:
    """Points and UVs of a floor that bends up into a wall behind the subject."""
    t = np.linspace(0, 1, 65)
    z = np.where(t < 0.55, 3.5 - t / 0.55 * 5.0, 0.0)
    y = np.zeros_like(t)
    bend = np.clip((t - 0.55) / 0.2, 0, 1) * math.pi / 2
    z = np.where(t >= 0.55, -1.5 - 1.0 * np.sin(bend), z)
    y = np.where(t >= 0.55, 1.0 - np.cos(bend), y)
    y = np.where(t > 0.75, 1.0 + (t - 0.75) * 14, y)
    x = np.linspace(-6, 6, 2)
    points = np.stack(
        [np.tile(x[:, None], (1, 65)), np.tile(y, (2, 1)), np.tile(z, (2, 1))], axis=-1
    )
    return points, points[..., :2]


def rect_light(
    stage: Usd.Stage, name: str, at: tuple[float, float, float], size: float, intensity: float,
    temperature: float,
) -> None:  # fmt: skip
    """Define a square light at `at` that shines on the middle of the scene."""
    light = UsdLux.RectLight.Define(stage, f"/World/Lights/{name}")
    light.CreateWidthAttr(size)
    light.CreateHeightAttr(size)
    light.CreateIntensityAttr(intensity)
    light.CreateEnableColorTemperatureAttr(True)
    light.CreateColorTemperatureAttr(temperature)
    light.AddTransformOp().Set(look_at(at, (0.0, 0.4, 0.0)))


def look_at(eye: tuple[float, float, float], at: tuple[float, float, float]) -> Gf.Matrix4d:
    """The transform of an object at `eye` whose -z axis points at `at`."""
    view = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*at), Gf.Vec3d(0, 1, 0))
    return view.GetInverse()


def camera(
    stage: Usd.Stage, eye: tuple[float, float, float], at: tuple[float, float, float],
    focal_length: float, name: str = "Camera",
) -> None:  # fmt: skip
    """Define a full-frame camera; `focal_length` is in millimetres."""
    prim = UsdGeom.Camera.Define(stage, f"/World/{name}")
    # USD measures focal length and aperture in tenths of a scene unit.
    prim.CreateFocalLengthAttr(focal_length * 0.01)
    prim.CreateHorizontalApertureAttr(36 * 0.01)
    prim.CreateVerticalApertureAttr(24 * 0.01)
    prim.CreateClippingRangeAttr((0.01, 1000.0))
    prim.CreateFocusDistanceAttr(math.dist(eye, at))
    prim.CreateFStopAttr(0.0)
    prim.AddTransformOp().Set(look_at(eye, at))


def grey(stage: Usd.Stage, path: str, color: tuple[float, float, float], roughness: float) -> None:
    """Define a plain UsdPreviewSurface."""
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(color)
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")


def bind(stage: Usd.Stage, mesh: Any, path: str) -> None:
    """Give a mesh a material."""
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(
        UsdShade.Material(stage.GetPrimAtPath(path))
    )


def dress(stage: Usd.Stage, mesh: UsdGeom.Mesh, cloth: str | Fabric, **binding: Any) -> None:
    """Make a mesh of a fabric or a preset's, by a material of the mesh's name; UVs are in metres.

    The material carries the fabric, and for other viewers a UsdPreviewSurface and OpenPBR.
    """
    fabric = load(cloth) if isinstance(cloth, str) else cloth
    where = f"/World/Looks/{fabric.name}"
    if not stage.GetPrimAtPath(where):
        write_fabric(stage, where, fabric)
    material = f"/World/Looks/{mesh.GetPrim().GetName()}"
    laid = Binding(fabric=fabric, metres_per_uv=1.0, **binding)
    write_fabric_material(stage, material, where, laid, looks=_looks(fabric))
    bind(stage, mesh, material)


@cache
def _looks(fabric: Fabric) -> Looks:
    return fitted_looks(fabric)


def make_cylinders(folder: Path) -> Path:
    """Three upright cylinders on which the warp runs upright, at 45 degrees, and round."""
    path = folder / "cylinders.usda"
    stage = new_scene(path)
    radius, height = 0.11, 0.5
    phi = np.linspace(0, 2 * math.pi, 257)
    y = np.linspace(0, height, 33)
    for k, (name, degrees) in enumerate((("Upright", 0), ("Bias", 45), ("Round", 90))):
        p, h = np.meshgrid(phi, y, indexing="ij")
        x0 = 0.3 * (k - 1)
        points = np.stack([x0 + radius * np.sin(p), h + 0.002, radius * np.cos(p)], axis=-1)
        uv = np.stack([radius * p, h], axis=-1)
        mesh = define_grid(stage, f"/World/{name}", Grid(points[:-1], uv, around=True))
        dress(stage, mesh, "polyester_satin_charmeuse", rotation=math.radians(degrees))
    camera(stage, (0.0, 0.55, 2.1), (0.0, 0.24, 0.0), 70.0)
    stage.GetRootLayer().Save()
    return path


def drum(stage: Usd.Stage, radius: float, height: float, edge: float) -> None:
    """Define the drum on which the cloth lies, 4 mm below the cloth."""
    gap = 0.004
    phi = np.linspace(0, 2 * math.pi, 65)[:-1, None]
    bend = np.linspace(0, math.pi / 2, 7)
    r = np.concatenate([[radius], radius - edge + edge * np.cos(bend), [0.001]]) - gap
    y = np.concatenate([[0.0], height - edge + edge * np.sin(bend), [height]]) - gap
    r, y = np.maximum(r, 0.001), np.maximum(y, 0.0)
    points = np.stack([r * np.sin(phi), np.broadcast_to(y, (64, len(y))), r * np.cos(phi)], axis=-1)
    u, v = np.meshgrid(np.linspace(0, 1, 65), np.linspace(0, 1, len(y)), indexing="ij")
    grey(stage, "/World/Looks/Drum", (0.32, 0.31, 0.30), 0.9)
    mesh = define_grid(stage, "/World/Drum", Grid(points, np.stack([u, v], axis=-1), around=True))
    bind(stage, mesh, "/World/Looks/Drum")


def make_drape(folder: Path, *, cells: int = 74, factor: int = 3, steps: int = 420) -> Path:
    """A cloth that hangs over a drum; 98 568 triangles at the usual size."""
    path = folder / "drape.usda"
    stage = new_scene(path)
    cloth = hung_square(radius=0.25, cells=cells, factor=factor, steps=steps)
    dress(stage, define_grid(stage, "/World/Cloth", cloth), "silk_shot")
    drum(stage, 0.25, 0.42, 0.03)
    camera(stage, (0.55, 0.95, 1.75), (0.0, 0.24, 0.0), 60.0)
    stage.GetRootLayer().Save()
    return path


def hung_square(*, radius: float, cells: int, factor: int, steps: int, size: float = 0.78) -> Grid:
    """A square of cloth that hangs over a drum 0.42 m high."""
    height = 0.42
    line = np.linspace(-size / 2, size / 2, cells + 1)
    x, z = np.meshgrid(line, line[::-1], indexing="ij")
    turn = math.radians(20)
    start = np.stack(
        [
            math.cos(turn) * x + math.sin(turn) * z,
            np.full_like(x, height + 0.02) + 0.002 * np.sin(31 * x) * np.cos(27 * z),
            math.cos(turn) * z - math.sin(turn) * x,
        ],
        axis=-1,
    )
    rest = np.stack([x, z], axis=-1)
    hung = simulate(
        start, rest, drum_body(radius, height, 0.03), steps=steps, passes=1, substeps=12
    )
    hung[..., 1] += 0.003
    fine = finer(hung, factor)
    return Grid(fine, finer(np.stack([x, -z], axis=-1), factor))


BODY_HEIGHTS = np.array([0.0, 0.10, 0.45, 0.52, 0.80, 0.90, 1.05, 1.22, 1.38, 1.44, 1.50])
BODY_RADII = np.array(
    [
        [0.075, 0.075], [0.080, 0.080], [0.110, 0.090], [0.120, 0.095], [0.172, 0.120],
        [0.180, 0.125], [0.132, 0.095], [0.150, 0.108], [0.165, 0.095], [0.090, 0.070],
        [0.055, 0.055],
    ]
)  # fmt: skip
"""A dressmaker's figure: half widths along x and z [m] at heights [m]."""


def make_skirt(folder: Path, *, around: int = 120, down: int = 44, steps: int = 420) -> Path:
    """A flared skirt of two panels on a dressmaker's figure; warp runs down the centre front."""
    path = folder / "skirt.usda"
    stage = new_scene(path)
    mesh = define_grid(stage, "/World/Skirt", hung_skirt(around=around, down=down, steps=steps))
    dress(stage, mesh, "polyester_satin_charmeuse")
    figure(stage)
    camera(stage, (0.75, 1.15, 3.3), (0.0, 0.78, 0.0), 115.0)
    stage.GetRootLayer().Save()
    return path


@cache
def hung_skirt(*, around: int, down: int, steps: int, factor: int = 3, substeps: int = 1) -> Grid:
    """The skirt as it hangs, from the hem upwards, so that the outside is the front.

    factor : by which the simulated grid is refined; substeps : more of them stretch it less
    """
    waist, length, sweep = 1.05, 0.58, math.radians(105)
    # Each panel is a sector of a ring; at the waist it is as long as half the girth of the figure.
    t = np.linspace(0, 2 * math.pi, around, endpoint=False)
    a, b = (np.interp(waist, BODY_HEIGHTS, BODY_RADII[:, k]) + 0.006 for k in range(2))
    girth = math.pi * (3 * (a + b) - math.sqrt((3 * a + b) * (a + 3 * b)))
    inner = 0.5 * girth / sweep
    s = np.linspace(0, length, down)
    tt, ss = np.meshgrid(t, s, indexing="ij")
    ring = (inner + ss) / inner
    start = np.stack(
        [
            a * np.sin(tt) * (1 + 0.75 * (ring - 1)),
            waist - 0.55 * ss,
            b * np.cos(tt) * (1 + 0.75 * (ring - 1)),
        ],
        axis=-1,
    )
    start[..., 0] *= 1 + 0.02 * np.sin(9 * tt) * ss / length
    start[..., 2] *= 1 + 0.02 * np.cos(11 * tt) * ss / length
    # Rest distances are those of the pattern: chords of rings, and straight lines down.
    flat = np.stack(
        [
            (inner + ss) * 2 * sweep / (2 * math.pi) * np.sin(tt),
            ss,
            (inner + ss) * 2 * sweep / (2 * math.pi) * np.cos(tt),
        ],
        axis=-1,
    )
    # On the cone that the pattern forms, a step down is also a step outwards.
    flat[..., 1] = np.sqrt(np.maximum(1 - (2 * sweep / (2 * math.pi)) ** 2, 0.05)) * ss
    pinned = np.zeros(start.shape[:2], bool)
    pinned[:, 0] = True
    body = turned_body(BODY_HEIGHTS, BODY_RADII, 0.006)
    hung = simulate(
        start, flat, body, pinned=pinned, around=True, steps=steps, bending=0.06,
        substeps=substeps, passes=12 if substeps == 1 else 1,
    )  # fmt: skip
    fine = finer(hung, factor, around=True) if factor > 1 else hung
    uv, cuts = _skirt_uv(fine.shape, inner, length, sweep)
    return Grid(fine[:, ::-1], uv[:, ::-1], True, cuts)


def _skirt_uv(
    shape: tuple[int, ...], inner: float, length: float, sweep: float
) -> tuple[NDArray[np.float64], tuple[int, int]]:
    """((m + 3, n, 2) [m] place of each point on its flat panel, columns before a seam).

    v runs up, u to the wearer's left. The panels meet at the sides, a quarter and three quarters of
    the way round. Each is symmetric about its own centre line, which is the grain; the back lies
    beside the front.
    """
    m, n = shape[:2]
    column = np.sort(np.concatenate([np.arange(m + 1), [m // 4, 3 * m // 4]]))
    cuts = (m // 4, 3 * m // 4 + 1)
    # 0 in front up to the first seam, 1 at the back, 2 in front again.
    panel = np.searchsorted(cuts, np.arange(m + 3))
    angle = (column / m * 2 - panel) * sweep
    outer = inner + length
    aa, ss = np.meshgrid(angle, np.linspace(0, length, n), indexing="ij")
    u = outer * np.where(panel == 1, 3.02, 1.0)[:, None] + (inner + ss) * np.sin(aa)
    return np.stack([u, outer - (inner + ss) * np.cos(aa)], axis=-1), cuts


def figure(stage: Usd.Stage) -> None:
    """Define a dressmaker's figure on its stand."""
    grey(stage, "/World/Looks/Figure", (0.55, 0.50, 0.45), 0.6)
    y = np.linspace(0.30, 1.50, 121)
    a = gaussian_filter(np.interp(y, BODY_HEIGHTS, BODY_RADII[:, 0]), 3) - 0.004
    b = gaussian_filter(np.interp(y, BODY_HEIGHTS, BODY_RADII[:, 1]), 3) - 0.004
    a[-4:] *= [0.95, 0.8, 0.5, 0.02]
    b[-4:] *= [0.95, 0.8, 0.5, 0.02]
    t = np.linspace(0, 2 * math.pi, 96, endpoint=False)
    tt, yy = np.meshgrid(t, y, indexing="ij")
    points = np.stack([a * np.sin(tt), yy, b * np.cos(tt)], axis=-1)
    uv = np.zeros((97, len(y), 2))
    body = define_grid(stage, "/World/Figure", Grid(points, uv, around=True))
    bind(stage, body, "/World/Looks/Figure")
    pole = np.stack(
        [
            0.015 * np.sin(tt[:, :2]),
            np.broadcast_to([0.0, 0.31], (96, 2)),
            0.015 * np.cos(tt[:, :2]),
        ],
        axis=-1,
    )
    stand = define_grid(stage, "/World/Stand", Grid(pole, np.zeros((97, 2, 2)), around=True))
    bind(stage, stand, "/World/Looks/Figure")


def make_garment(path: Path) -> Path:
    """The skirt that the package ships, see `fabricusd.samples.garment`: hardly stretched."""
    grid = hung_skirt(around=120, down=44, steps=420, factor=1, substeps=24)
    np.savez_compressed(path, points=grid.points.astype(np.float32), uv=grid.uv.astype(np.float32))
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the sample scenes.")
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).resolve().parent)
    parser.add_argument(
        "--garment", type=Path, help="make only the garment of the package, as this .npz"
    )
    options = parser.parse_args()
    if options.garment:
        print(make_garment(options.garment))
        return
    folder = options.folder
    folder.mkdir(parents=True, exist_ok=True)
    from lit_from_behind import make_curtain, make_lit_drape, make_lit_skirt

    for make in (
        make_cylinders, make_drape, make_skirt, make_lit_drape, make_lit_skirt, make_curtain,
    ):  # fmt: skip
        print(make(folder))


if __name__ == "__main__":
    main()
