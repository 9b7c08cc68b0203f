"""Write docs/geometry.md and geometry_conserving.md: the laws against tubes, from shipped tables.

python docs/make_geometry.py
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from fabricusd.appearance import laws, surface
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.geometry import tubes
from fabricusd.geometry.conserve import refitted_names, reflectance
from fabricusd.geometry.judge import judge
from fabricusd.geometry.nearest import APPEARANCE, CONSERVING
from fabricusd.geometry.tables import (
    AZIMUTHS,
    COUNT,
    PAIRS,
    POLAR,
    SHADES,
    SKY_COUNT,
    Table,
    conserving,
    table,
    table_names,
    views,
)
from fabricusd.quality.colors import delta_e_2000
from fabricusd.schema import load, published_names

HERE = Path(__file__).resolve().parent
SHOWN = (0.0, 45.0, 75.0, 85.0)

HEAD = """# Geometry: what the laws are judged by

Made by `make docs` (`python docs/make_geometry.py`) from the tables in `fabricusd/geometry/data`,
which `python -m fabricusd.geometry.tables` remakes.

The repeat is built as elliptical tubes and traced. Threads are the bands of
`appearance.weave.bands`; the tangent curve lies once over each run that is seen, a cubic joins the
runs underneath; sections are as high as threads that cross leave room. Volume light leaves a
thread anywhere on its lit side, surface light at the mirror of where it came in. Published threads
reflect more than they get, so their light scatters once; `conserving` threads let it go on until
it leaves.

[Conserving threads against tubes](geometry_conserving.md) has a page of its own.
"""

CONSERVING_HEAD = """# Conserving threads against tubes

Made by `make docs` (`python docs/make_geometry.py`). [Geometry](geometry.md) says what the tubes
are.
"""

LAW = """## The laws at level `far`

{pairs} pairs of directions a preset, {count} paths each: a third anywhere within 80° of the
normal, a third near the mirror direction, a third lit from 3 to 15° above the cloth. *error* is
the mean absolute difference over the tubes' mean, *bias* the mean difference, ΔE the CIE 2000
difference of colours in which a white diffuser that faces the light is 1. *held out* is over the
third of the pairs that nothing is fitted to.

The last four columns are the tubes' own uncertainty: the noise, and how far their values move (mean
absolute change over mean) when surface light leaves anywhere, when sections are .7 as high, and
when light goes by the width that a thread shows.

Laws are those of `fabric:surfaceLaw`, each with the shadow `horizon`; *no shadow* is the error of
the law without it. The preset wears the law with a star.

| preset | law | held out: error | bias | ΔE | no shadow | all | ΔE | grazing | noise | exit \
| height | width |
|---|---|---|---|---|---|---|---|---|---|---|---|---|"""

SKY = """
## A white sky

Reflected of a white sky by the preset as it is, brightest channel, mean over azimuths of
{azimuths}: tubes, law `masked`, the law that the preset wears with its shadow `horizon`.
Tubes: {count} paths a view, standard error below {error:.3f}. Laws with an absolute shadow stop
at 1, where tubes of published threads go beyond.

| preset | {columns} |
|---|{rule}"""

SHARES = """## By side

Reflected, transmitted and passed by the gap, of a white sky, with the preset's threads in
`conserving` at A = {shades}: first after one scattering, then after all, then the law with the
shares by side that the preset states (`fabricusd sides`, other paths than these). *lost* ends
where tubes overlap, which the law counts as leaving on both sides alike, and on velvet's backing,
which the law takes to be white.

| preset | angle | gap | once R | once T | R | T | law R | law T | lost |
|---|---|---|---|---|---|---|---|---|---|"""

SECOND = """
## The presets in `conserving`

`PRESET{appearance=conserving}` is a second opinion: the preset's threads under the conserving law,
each as bright as comes nearest to the preset over the pairs of [geometry](geometry.md), up to an
albedo of 1 (`python -m fabricusd.geometry.conserve`). Published threads are brighter than white, so
most stop at 1 and stay darker. *white sky* is what is reflected of one at 8°, brightest channel:
preset, conserving. ΔE is over the pairs; with `conserving` scaled to the preset's mean, what is
left is shape.

| preset | albedos | white sky | error | ΔE | ΔE scaled |
|---|---|---|---|---|---|"""

REFUSED = """
## What has no geometry

| preset | why |
|---|---|"""


def law_row(name: str, law: str, found: Table) -> str:
    """One preset under one law, against its tubes."""
    preset = load(name)
    fabric = replace(preset, surface_law=law)
    value = surface.evaluate(fabric, found.wi, found.wo, level="far", shadow="horizon")
    open_ = judge(found, surface.evaluate(fabric, found.wi, found.wo, level="far"))
    held, whole = judge(found, value), judge(found, value, np.ones(len(value), bool))
    grazing = judge(found, value, np.arange(len(value)) % 3 == 2)
    return (
        f"| {name} | {law}{'*' if law == preset.surface_law else ''} "
        f"| {held.error:.2f} | {held.bias:+.2f} | {held.delta_e:.1f} | {open_.error:.2f} "
        f"| {whole.error:.2f} | {whole.delta_e:.1f} | {grazing.error:.2f} | {whole.noise:.3f} "
        f"| {float(found.exit):.2f} | {float(found.height):.2f} | {float(found.width):.2f} |"
    )


def by_angle(values: np.ndarray) -> np.ndarray:
    """(polar, ...) means over the azimuths of a table's views."""
    return values.reshape(-1, len(AZIMUTHS), *values.shape[1:]).mean(axis=1)


def hemisphere(rings: int = 24, azimuths: int = 48) -> np.ndarray:
    """(k, 3) directions above the cloth, each for the same solid angle."""
    z = (np.arange(rings) + 0.5) / rings
    turn = 2 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    z, turn = (x.ravel() for x in np.meshgrid(z, turn, indexing="ij"))
    r = np.sqrt(1 - z * z)
    return np.stack((r * np.cos(turn), r * np.sin(turn), z), axis=1)


def law_shares(fabric: Fabric, side: int, seen: np.ndarray, shadow: str = "none") -> np.ndarray:
    """(v, 3) of a white sky at `far` from `seen` (v, 3): from its side (1), from the other (-1)."""
    sky = hemisphere() * (1, 1, side)
    return np.array(
        [surface.evaluate(fabric, sky, wo, shadow=shadow).mean(axis=0) * 2 * np.pi for wo in seen]
    )


def share_rows(name: str, found: Table) -> list[str]:
    """One preset's `conserving` shares, a row an angle and shade."""
    fabric = conserving(load(name))
    shown = views().reshape(len(POLAR), -1, 3)[[POLAR.index(a) for a in SHOWN]].reshape(-1, 3)
    law = [by_angle(law_shares(fabric, side, shown)) for side in (1, -1)]
    columns = [by_angle(x) for x in (found.once_up, found.once_down, found.up, found.down)]
    gap, lost = by_angle(found.gap), by_angle(found.lost)
    rows = []
    for row, angle in enumerate(SHOWN):
        k = POLAR.index(angle)
        values = [x[k] for x in columns] + [x[row] for x in law]
        cells = [" / ".join(f"{v:.2f}" for v in x) for x in values]
        rows.append(
            f"| {name} | {angle:g}° | {gap[k]:.3f} | {' | '.join(cells)} | {lost[k, 0]:.3f} |"
        )
    return rows


def second_row(name: str) -> str:
    """A preset's second opinion."""
    preset, other = load(name), load(f"{name}{{{APPEARANCE}={CONSERVING}}}")
    here, there = reflectance(other), reflectance(preset)
    scaled = here * (there.mean() / here.mean())
    error = np.abs(here - there).mean() / there.mean()
    delta, shape = (delta_e_2000(np.pi * x, np.pi * there).mean() for x in (here, scaled))
    wo = np.array([[np.sin(np.radians(8.0)), 0.0, np.cos(np.radians(8.0))]])
    sky = [law_shares(f, 1, wo, surface.mean_shadow(f)).max() for f in (preset, other)]
    albedos = "; ".join(" ".join(f"{a:.2f}" for a in t.albedo) for t in other.thread_list)
    return (
        f"| {name} | {albedos} | {sky[0]:.2f} {sky[1]:.2f} | {error:.2f} | {delta:.1f} "
        f"| {shape:.1f} |"
    )


def main() -> None:
    """Write the pages."""
    found = {name: table(name) for name in table_names()}
    lines = [HEAD, LAW.format(pairs=PAIRS, count=COUNT)]
    lines += [law_row(name, law, t) for name, t in found.items() for law in laws.REGISTRY]
    error = max(float(t.sky_error.max()) for t in found.values())
    columns = " | ".join(f"{p:g}°" for p in POLAR)
    lines.append(
        SKY.format(
            azimuths=", ".join(f"{a:g}°" for a in AZIMUTHS), count=SKY_COUNT, error=error + 5e-4,
            columns=columns, rule="---|" * len(POLAR),
        )
    )  # fmt: skip
    for name, t in found.items():
        worn = [
            by_angle(law_shares(fabric, 1, views(), surface.mean_shadow(fabric)))
            for fabric in (replace(load(name), surface_law="masked"), load(name))
        ]
        truth = by_angle(t.sky)
        bright = truth.mean(axis=0).argmax()
        columns_of = [x[:, bright] for x in (truth, *worn)]
        cells = [" ".join(f"{x:.2f}" for x in row) for row in zip(*columns_of, strict=True)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    lines.append(REFUSED)
    for name in sorted(set(published_names()) - set(found)):
        try:
            tubes(load(name))
        except FabricError as reason:
            lines.append(f"| {name} | {reason} |")
    (HERE / "geometry.md").write_text("\n".join(lines) + "\n", "utf-8")
    lines = [CONSERVING_HEAD, SHARES.format(shades=", ".join(f"{s:g}" for s in SHADES))]
    for name, t in found.items():
        lines += share_rows(name, t)
    lines.append(SECOND)
    lines += [second_row(name) for name in refitted_names()]
    (HERE / "geometry_conserving.md").write_text("\n".join(lines) + "\n", "utf-8")


if __name__ == "__main__":
    main()
