"""Where the published formulas fail, and what is computed instead: `docs/model.md` section 10.

A case is a sweep of one variable, with the values of the published formula and of ours along it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import plain
from fabricusd.appearance.conserving.multiple import conserving_tables
from fabricusd.appearance.scattering import plain_lobes
from fabricusd.appearance.surface import evaluate
from fabricusd.appearance.thread import evaluate as thread_value
from fabricusd.appearance.weave.footprint import weights
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.chart.cloth_picture import difference, ideal_spectrum, picture, view_of
from fabricusd.chart.draw import pyplot, save
from fabricusd.chart.scenes import cloth, facing
from fabricusd.fabric import PILE_ANGLE, Fabric, even
from fabricusd.files import whole_file
from fabricusd.geometry.nearest import published
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import SPHERE
from fabricusd.scene.scene import Light, Mesh, Scene
from fabricusd.schema import load

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Case:
    """One kind of failure.

    axis : label of the sweep `x`; unit : label of the values
    published, ours : (n,) values along the sweep; NaN and infinity are left in
    said : what happens to the published formula, and what ours does instead
    """

    where: str
    axis: str
    unit: str
    x: Floats
    published: Floats
    ours: Floats
    said: str
    log_x: bool = False
    log_y: bool = True


def _up(theta: Floats, phi: Floats | float = 0.0) -> Floats:
    """(n, 3) unit vectors at polar angle theta and azimuth phi [rad]."""
    phi = np.broadcast_to(phi, theta.shape)
    s = np.sin(theta)
    return np.stack((s * np.cos(phi), s * np.sin(phi), np.cos(theta)), axis=-1)


def mirror_at_grazing() -> Case:
    """`theta_o = -theta_i`, approaching 90 degrees."""
    away = np.geomspace(0.01, 45.0, 60)
    theta = np.radians(90.0 - away)
    wi, wo = _up(theta), _up(-theta)
    thread = next(iter(even(load("linen_plain")).threads.values()))
    return Case(
        where="theta_i, theta_o → ±90°", axis="degrees from the thread's axis",
        unit="f_s [1/sr]", x=away,
        published=thread_value(thread, wi, wo, "microcylinder").mean(axis=1),
        ours=thread_value(thread, wi, wo, "conserving").mean(axis=1) * np.cos(theta),
        said="f_s grows without bound, and only f_s cos theta integrates; floors keep it finite; "
        "the plot shows `conserving` times its cosine, which has a limit",
        log_x=True,
    )  # fmt: skip


def along_the_thread() -> Case:
    """A direction that approaches the axis of the thread."""
    off = np.geomspace(1e-20, 1e-1, 60)
    wi = np.stack((np.ones_like(off), 0.6 * off, 0.8 * off), axis=-1)
    wi[0, 1:] = 0.0
    wo = np.tile([-0.6, 0.0, 0.8], (len(off), 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        # As printed: the azimuth of the normalised projection onto the normal plane.
        length = np.sqrt(np.maximum(1.0 - (wi[:, 0] / np.linalg.norm(wi, axis=1)) ** 2, 0.0))
        azimuth = np.degrees(np.arccos(np.clip(0.8 * off / length, -9, 9)))
    exact = np.degrees(plain_lobes.angles(wi).phi)
    thread = next(iter(even(load("linen_plain")).threads.values()))
    assert np.isfinite(thread_value(thread, wi / np.linalg.norm(wi, axis=1)[:, None], wo)).all()
    return Case(
        where="w parallel to t or b", axis="distance from the thread's axis",
        unit="azimuth phi [degrees]", x=off, published=azimuth, ours=exact, log_x=True, log_y=False,
        said="the azimuth of a projection of no length is 0/0; it is not a number below 1e-8, "
        "and noise well before that; atan2 keeps the azimuth at every distance, and atan2(0, 0) "
        "= 0",
    )  # fmt: skip


def wide_lobes() -> Case:
    """Area of a longitudinal lobe, from a needle to more than a hemisphere."""
    widths = np.geomspace(0.05, 180.0, 50)
    lobes = np.radians(widths)
    published, ours = np.empty(50), np.empty(50)
    for k, s in enumerate(lobes):
        reach = min(12.0 * s, 0.5 * math.pi)
        b = np.linspace(-reach, reach, 20001)
        published[k] = np.trapezoid(plain_lobes.gaussian(float(s), b), b)
        ours[k] = np.trapezoid(
            plain_lobes.longitudinal(np.zeros_like(b), b, float(s)) * np.cos(b), b
        )
    return Case(
        where="gs → 0, gv ≥ 60°", axis="lobe width [degrees]", unit="area of the lobe", x=widths,
        published=published, ours=ours, log_x=True, log_y=False,
        said="the Gaussian's area outside ±90° is lost, a third of it at 90°; K integrates to 1 at "
        "every width, in a form that stays finite for very narrow lobes",
    )  # fmt: skip


def _linen() -> Fabric:
    """Linen with the published numbers and the published law, without unevenness."""
    return even(published("linen_plain"))


def _albedo(fabric: Fabric, degrees: float, count: int = 1500) -> float:
    """Reflected share of an even sky, towards a viewer `degrees` from the normal.

    Single scattering, by the plain implementation of the laws.
    """
    rng = np.random.default_rng(0)
    wi = _up(np.arccos(rng.random(count)), 2 * math.pi * rng.random(count))
    wo = np.tile(_up(np.radians([degrees])), (count, 1))
    if fabric.model == "conserving":
        sides = conserving_tables(fabric).sides
        value = plain.conserving_far(fabric, wi, wo, per_segment=12, sides=sides)
    else:
        value = plain.far(fabric, wi, wo, per_segment=12)
    return 2 * math.pi * float(value.mean())


def white_furnace() -> Case:
    """Share of an even sky that linen with `A` = 1 reflects."""
    degrees = np.linspace(0.0, 88.0, 12)
    values = {
        model: np.array([_albedo(plain.white(replace(_linen(), model=model)), d) for d in degrees])
        for model in ("microcylinder", "conserving")
    }
    return Case(
        where="A at 0 and 1, eta = 1 and large", axis="view from the normal [degrees]",
        unit="albedo of white cloth, single scattering", x=degrees,
        published=values["microcylinder"], ours=values["conserving"], log_y=False,
        said="A is not an albedo: linen reflects all light at A = 1, satin at A = 0.30; "
        "`conserving` stays below 1 at every angle, and multiple scattering adds what is missing "
        "([albedo.md](albedo.md))",
    )  # fmt: skip


def steep_curves() -> Case:
    """Height of a hump whose sides become steeper."""
    steepest = np.linspace(10.0, 90.0, 81)
    with np.errstate(divide="ignore"):
        published = 0.25 * np.tan(np.radians(steepest))
    published[-1] = np.inf
    return Case(
        where="±90° tangents", axis="steepest tangent angle [degrees]", unit="height over run",
        x=steepest, published=published, ours=np.where(steepest > 85.0, 0.0, published),
        said="the integral of the tangent diverges; curves beyond 85° are pile, without height or "
        "shadow; pieces of zero length are jumps without weight",
    )  # fmt: skip


def far_uv() -> Case:
    """The place inside a thread, at UVs farther and farther from 0."""
    offsets = np.asarray(2.0 ** np.arange(0, 40), np.float64)
    fabric = even(load("linen_plain"))
    place = np.array([[0.6180, 0.3]])
    exact = float(lookup(fabric, place).across[0])
    ours, single = np.empty(len(offsets)), np.empty(len(offsets))
    for k, shift in enumerate(offsets):
        moved = place + 2.0 * shift
        ours[k] = abs(float(lookup(fabric, moved).across[0]) - exact)
        # As found by a renderer that stores UVs in single precision.
        rounded = (moved.astype(np.float32) - np.float32(2.0 * shift)).astype(np.float64)
        single[k] = float(np.abs(rounded - place).max()) * 2.0
    return Case(
        where="UV in the 10⁴ range", axis="threads from the origin", unit="error of the place",
        x=2.0 * offsets, published=np.maximum(single, 1e-17), ours=np.maximum(ours, 1e-17),
        log_x=True,
        said="single precision loses the place inside the thread; cell and fraction are split in "
        "float64 and reduced modulo the repeat first",
    )  # fmt: skip


def middle_distance() -> Case:
    """Moiré of point samples and of `auto`, 4×4 samples, crepe."""
    widths = np.array([0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 9.0, 17.0])
    fabric = even(published("silk_crepe_de_chine"))
    point, filtered, real = [], [], []
    for width in widths:
        view = view_of(fabric, float(width))
        ideal = ideal_spectrum(view)
        x = view.threads_per_pixel
        share = float(weights(fabric, [[x, x]])[0, 0])
        mixed = share * picture(view, "far", 1) + (1 - share) * picture(view, "weave", 4)
        real.append(x)
        point.append(difference(picture(view, "weave", 1), ideal).alias)
        filtered.append(difference(mixed, ideal).alias)
    return Case(
        where="mid distance, a thread per pixel", axis="threads a pixel", unit="alias over mean",
        x=np.array(real), published=np.array(point), ours=np.maximum(np.array(filtered), 1e-4),
        log_x=True,
        said="point samples fold every frequency into moiré; ours is `auto` with 4×4 samples; "
        "[charts.md](charts.md) shows alias and blur separately",
    )  # fmt: skip


def growing_energy() -> Case:
    """Energy after bounces between two linen walls, for the worst view, by `A`."""
    scale = np.linspace(0.25, 3.0, 8)
    found = {
        model: np.array(
            [
                max(_albedo(plain.white(cloth, float(s)), d, 600) for d in (0, 40, 80)) ** 8
                for s in scale
            ]
        )
        for model in ("microcylinder", "conserving")
        for cloth in [replace(_linen(), model=model)]
    }
    return Case(
        where="A too large", axis="A", unit="energy after 8 bounces", x=scale,
        published=found["microcylinder"], ours=found["conserving"],
        said="above an A of about 1, linen reflects more light than arrives, and bounces "
        "multiply it; `check` warns above the safe value, and `conserving` clamps A to 1",
    )  # fmt: skip


def below_the_cloth() -> Case:
    """A viewer that sinks below the surface of velvet."""
    elevation = np.linspace(20.0, -20.0, 81)
    fabric = even(load("velvet"))
    wo = _up(np.radians(90.0 - elevation))
    wi = np.tile(_up(np.radians([50.0]), 2.0), (len(wo), 1))
    value = sum(
        weight * share.area * plain.segment(fabric, share, float(psi0), wi, wo)
        for share in plain.shares(fabric)
        for psi0, weight in zip(*plain.curve_points(share.thread.curve, 32), strict=True)
    )
    q = plain.normalization(fabric, wi, wo, 32)
    with np.errstate(invalid="ignore", divide="ignore"):
        published = np.abs(np.asarray(value).mean(axis=1) / q)
    return Case(
        where="light or viewer below opaque cloth", axis="elevation of the viewer [degrees]",
        unit="radiance", x=elevation, published=np.maximum(published, 1e-6),
        ours=np.maximum(evaluate(fabric, wi, wo).mean(axis=1), 1e-6),
        said="below velvet both the sum and the Q that divides it are 0; ours returns 0 at or "
        "below the cloth without evaluating either",
    )  # fmt: skip


def upright_threads() -> Case:
    """Weight of a facet that turns away from the normal of the surface."""
    angle = np.linspace(60.0, 89.99, 80)
    cosine = np.cos(np.radians(angle))
    return Case(
        where="n_t·N → 0 (pile) in `conserving`", axis="tangent angle [degrees]",
        unit="facet area over its shadow", x=angle, published=1.0 / cosine,
        ours=1.0 / np.maximum(cosine, math.cos(PILE_ANGLE)),
        said="the integral of 1/(n_t·N) over a curve diverges logarithmically; angles are "
        "clamped to 85°",
    )  # fmt: skip


def light_at_the_surface() -> Case:
    """A ball of light that sinks into the cloth, from a metre away until its centre is below it."""
    heights = np.concatenate(([0.001, 0.003, 0.006, 0.009], np.geomspace(0.0101, 1.0, 20)))
    radius, linen = 0.01, even(load("linen_plain"))
    side = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    corners = np.array([[0, 1, 2], [0, 2, 3]])
    plane = Mesh(
        path="/plane", points=side, triangles=corners, uv=side[corners][..., :2],
        material=np.zeros(2, int),
    )  # fmt: skip

    def seen(height: float) -> float:
        frame = np.eye(4)
        frame[2, 3] = height
        light = Light(
            path="/ball", kind=SPHERE, radius=radius, frame=frame, camera_visible=False,
            radiance=(1.0 / (math.pi * radius**2),) * 3,
        )  # fmt: skip
        scene = Scene(
            meshes=[plane], materials=[cloth(linen)], lights=[light], camera=facing(1e-4, 1e-4)
        )
        made = render_scene(
            scene, width=4, height=4, spp=64, level="far", max_bounces=0, pixel_filter="box"
        )
        return float(made.layers["beauty"][..., :3].mean())

    ours = np.array([seen(h) for h in heights])
    return Case(
        where="light at or inside the surface", axis="height of the light's centre [m]",
        unit="irradiance [W/m²] of 1 W/sr", x=heights, published=1.0 / heights**2,
        ours=ours / ours[-1] / heights[-1] ** 2, log_x=True,
        said="1/r² of a point grows without bound; a ball gives no more than its radiance; a place "
        "inside the ball does not see the ball's outside",
    )  # fmt: skip


CASES: tuple[Callable[[], Case], ...] = (
    mirror_at_grazing, along_the_thread, wide_lobes, white_furnace, steep_curves, far_uv,
    middle_distance, growing_energy, below_the_cloth, upright_threads, light_at_the_surface,
)  # fmt: skip

ELSEWHERE = {
    "degenerate, mirrored, overlapping or missing UV": "refused, or reported in a note; "
    "tests/bake/layout/test_garment.py, tests/scene/usd/test_stage.py",
    "a 1×1 and a 4096×4096 grid": "tests/appearance/test_failures.py",
    "grazing camera on a thin fold": "rays start beside the shading point; "
    "tests/reference/test_terminator.py",
}
"""Rows of section 10 that are not formulas of one variable, and what is done about them."""


def write_stability(page: Path, images: Path) -> list[Path]:
    """Write the page, and into `images` one picture with a plot per case; return the files."""
    cases = [make() for make in CASES]
    plt = pyplot()
    figure, grid = plt.subplots(4, 3, figsize=(13, 13), layout="constrained")
    for axes, case in zip(grid.ravel(), cases, strict=False):
        axes.plot(case.x, case.published, "C3-", lw=1.2, label="published")
        axes.plot(case.x, case.ours, "C0--", lw=1.2, label="ours")
        axes.set_xscale("log" if case.log_x else "linear")
        axes.set_yscale("log" if case.log_y else "linear")
        axes.set(xlabel=case.axis, ylabel=case.unit)
        axes.set_title(case.where, fontsize=9)
        axes.grid(alpha=0.3)
    for axes in grid.ravel()[len(cases) :]:
        axes.set_axis_off()
    grid[0, 0].legend(fontsize=8)
    written = save(figure, images / "stability", (".png",))
    with whole_file(page) as temporary:
        temporary.write_text(_text(cases, written[0], page), encoding="utf-8")
    return [*written, page]


def _text(cases: list[Case], image: Path, page: Path) -> str:
    lines = [
        "# Where formulas fail\n",
        f"`fabricusd chart -o {image.parent.as_posix()} --stability {page.as_posix()}` makes this "
        "page. For each row of section 10 of [model.md](model.md), it evaluates the published "
        "formula along a sweep, and what fabricusd computes instead.\n",
        f"![Published and ours along each sweep]({image.relative_to(page.parent).as_posix()})\n",
        "| where | along | published, at worst | ours, at worst | what happens |",
        "|---|---|---|---|---|",
    ]
    for case in cases:
        worst = (_worst(case.published), _worst(case.ours))
        lines.append(f"| {case.where} | {case.axis} | {worst[0]} | {worst[1]} | {case.said} |")
    lines.append("\nThese rows are not sweeps:\n")
    lines += [f"- {where}: {what}." for where, what in ELSEWHERE.items()]
    return "\n".join(lines) + "\n"


def _worst(values: Floats) -> str:
    bad = int(np.count_nonzero(~np.isfinite(values)))
    return f"not finite at {bad}" if bad else f"{np.abs(values).max():.3g}"
