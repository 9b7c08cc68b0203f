"""Lobes: the measured scattering of one thread, a row a view; as a table in a CSV or an npz."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, one_line, reads
from fabricusd.files import readable_file, whole_file
from fabricusd.measure.angles import DEGREE, degrees_key, direction, folded, listed

Floats = NDArray[np.float64]

FIRST_LINE = "# fabricusd lobes 1"
ANGLES = ("theta_i", "theta_o", "phi_d")
VALUES = ("f_r", "f_g", "f_b")
SIGMAS = ("sigma_r", "sigma_g", "sigma_b")
COLUMNS = (*ANGLES, *VALUES, *SIGMAS)

ASSUMED_RELATIVE, ASSUMED_FLOOR = 0.03, 0.002
"""Standard deviation assumed of a table that states none: a share of the value, and a floor in
units of the value's median over ten."""

WIDE_GAP = 2.5
"""A step between views is a gap if it is this many times the usual one."""
HIDDEN = 7.0
"""Degrees around the light's inclination, or its opposite, where a camera has no view."""


@dataclass(frozen=True, kw_only=True)
class Lobes:
    """Measured `f_s` of one thread, as in eq. 4.3: without the cosine.

    theta_i, theta_o : (n,) - inclinations of light and camera from the normal plane [rad]
    phi_d : (n,) - azimuth between them, in [0, pi] [rad]
    f : (n, 3) - red, green, blue [1/sr]
    sigma : (n, 3) - standard deviations of `f`, above 0
    absolute : whether `f` is in 1/sr; otherwise one unknown factor is common to all of it
    name : of the thread
    notes : what was assumed, left out or doubtful
    """

    theta_i: Floats
    theta_o: Floats
    phi_d: Floats
    f: Floats
    sigma: Floats
    absolute: bool = True
    name: str = "thread"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.theta_i)
        for name, shape in (
            ("theta_o", (n,)), ("phi_d", (n,)), ("f", (n, 3)), ("sigma", (n, 3)),
        ):  # fmt: skip
            given = getattr(self, name).shape
            if given != shape:
                raise FabricError(name, f"has shape {given}; it must be {shape}")
        for name in ("theta_i", "theta_o", "phi_d", "f", "sigma"):
            bad = int(np.count_nonzero(~np.isfinite(getattr(self, name))))
            if bad:
                raise FabricError(name, f"holds {bad} number(s) that are not finite")
        if n and not (self.sigma > 0).all():
            raise FabricError("sigma", "holds a number that is not above 0")

    def __len__(self) -> int:
        return len(self.theta_i)

    @property
    def wi(self) -> Floats:
        """(n, 3) unit vectors to the light, in the thread frame."""
        return direction(self.theta_i, 0.0)

    @property
    def wo(self) -> Floats:
        """(n, 3) unit vectors to the camera, in the thread frame."""
        return direction(self.theta_o, self.phi_d)

    @property
    def incidences(self) -> Floats:
        """(k,) the inclinations of the light, sorted [rad]."""
        return np.unique(np.round(self.theta_i / DEGREE, 2)) * DEGREE

    def of(self, kept: NDArray[Any]) -> Lobes:
        """The rows that a mask or an array of indices keeps."""
        return Lobes(
            theta_i=self.theta_i[kept], theta_o=self.theta_o[kept], phi_d=self.phi_d[kept],
            f=self.f[kept], sigma=self.sigma[kept], absolute=self.absolute, name=self.name,
            notes=self.notes,
        )  # fmt: skip


def gaps(lobes: Lobes) -> Iterator[str]:
    """A line for each stretch of theta_o without a view, per incidence and azimuth.

    The places where the camera would hide the light, or look into it, are no gaps.
    """
    keys = [degrees_key(i, p) for i, p in zip(lobes.theta_i, lobes.phi_d, strict=True)]
    groups: dict[tuple[float, ...], list[float]] = {}
    for key, o in zip(keys, lobes.theta_o, strict=True):
        groups.setdefault(key, []).append(float(o) / DEGREE)
    steps = [np.diff(np.unique(np.round(v, 2))) for v in groups.values() if len(v) > 2]
    usual = float(np.median(np.concatenate(steps))) if steps else 0.0
    for (incidence, azimuth), seen in groups.items():
        views = np.unique(np.round(seen, 2))
        for low, high in pairwise(views):
            hidden = -incidence if azimuth > 90.0 else incidence
            allowed = 2 * HIDDEN + 2 * usual if low < hidden < high else WIDE_GAP * usual
            if high - low > max(allowed, WIDE_GAP * usual) and usual > 0:
                yield (
                    f"incidence {incidence:g}, azimuth {azimuth:g}: there are no views between "
                    f"theta_o {low:g} and {high:g} degrees"
                )


def write_lobes(lobes: Lobes, path: str | os.PathLike[str], *, clobber: bool = True) -> None:
    """Write a table as CSV or npz, told by the suffix, whole or not at all; angles in degrees."""
    suffix = Path(path).suffix.lower()
    if suffix not in (".csv", ".npz"):
        raise FabricError(str(path), "is not a table of lobes; it must end in .csv or .npz")
    angles = np.stack([lobes.theta_i, lobes.theta_o, lobes.phi_d], axis=1) / DEGREE
    with whole_file(path, clobber=clobber) as temporary:
        if suffix == ".npz":
            np.savez(
                temporary, angles=angles, f=lobes.f, sigma=lobes.sigma,
                absolute=np.array(lobes.absolute), name=np.array(lobes.name),
                notes=np.array(lobes.notes, dtype=str),
            )  # fmt: skip
            return
        lines = [FIRST_LINE, f"# name: {one_line(lobes.name)}"]
        lines.append(f"# absolute: {'yes' if lobes.absolute else 'no'}")
        lines += [f"# note: {one_line(note)}" for note in lobes.notes]
        lines.append(",".join(COLUMNS))
        for angle, f, sigma in zip(angles, lobes.f, lobes.sigma, strict=True):
            numbers = [f"{x:.7g}" for x in angle]
            numbers += [f"{x:.9g}" for x in (*f, *sigma)]
            lines.append(",".join(numbers))
        temporary.write_text("\n".join(lines) + "\n", "utf-8")


@reads("a table of lobes")
def read_lobes(path: str | os.PathLike[str]) -> Lobes:
    """Read what `write_lobes` writes, or a CSV with the columns theta_i to f_b in any order.

    Columns sigma_ may be missing; then a standard deviation is assumed and noted. Raises
    FabricError, with the line, for numbers that are missing or not finite.
    """
    where = str(readable_file(path))
    if Path(path).suffix.lower() == ".npz":
        return _read_npz(where)
    with open(where, encoding="utf-8-sig", newline="") as stream:
        text = stream.read()
    told: dict[str, str] = {}
    notes = []
    body = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("#"):
            key, _, value = line[1:].partition(":")
            if key.strip() == "note":
                notes.append(value.strip())
            told[key.strip()] = value.strip()
        elif line.strip():
            body.append((number, line))
    if not body:
        raise FabricError(where, "holds no table; it must have a line of column names")
    header = [name.strip() for name in next(csv.reader(io.StringIO(body[0][1])))]
    missing = [name for name in (*ANGLES, *VALUES) if name not in header]
    if missing:
        raise FabricError(
            where, f"lacks the column(s) {', '.join(missing)}; it must have {', '.join(COLUMNS)}"
        )
    rows = _numbers(where, body[1:], header)
    if not len(rows):
        raise FabricError(where, "holds no views; it must have a line for each")
    columns = {name: rows[:, k] for k, name in enumerate(header)}
    f = np.stack([columns[name] for name in VALUES], axis=1)
    if all(name in columns for name in SIGMAS):
        sigma = np.stack([columns[name] for name in SIGMAS], axis=1)
        if not (sigma > 0).all():
            bad = body[1 + int(np.flatnonzero(~(sigma > 0).all(axis=1))[0])][0]
            raise FabricError(f"{where} line {bad}", "has a sigma that is not above 0")
    else:
        floor = ASSUMED_FLOOR * 10 * float(np.median(np.abs(f)))
        sigma = np.hypot(ASSUMED_RELATIVE * np.maximum(f, 0), max(floor, 1e-12))
        notes.append(
            f"the table states no sigma: {ASSUMED_RELATIVE:.0%} of each value and a floor of "
            f"{floor:.2g} are assumed"
        )
    angles = np.stack([columns[name] for name in ANGLES], axis=1)
    return _made(where, angles, f, sigma, told.get("absolute", "yes") != "no",
                 told.get("name") or Path(path).stem, tuple(notes))  # fmt: skip


def _numbers(where: str, body: list[tuple[int, str]], header: list[str]) -> Floats:
    """(n, columns) the numbers of the rows below the header."""
    rows = np.empty((len(body), len(header)))
    for k, (number, line) in enumerate(body):
        fields = next(csv.reader(io.StringIO(line)))
        if len(fields) != len(header):
            raise FabricError(
                f"{where} line {number}", f"has {len(fields)} fields; it must have {len(header)}"
            )
        for j, (name, field) in enumerate(zip(header, fields, strict=True)):
            try:
                rows[k, j] = float(field)
            except ValueError:
                rows[k, j] = np.nan
            if name in COLUMNS and not np.isfinite(rows[k, j]):
                raise FabricError(
                    f"{where} line {number}",
                    f"has '{one_line(field, 40)}' for {name}; it must be a finite number",
                )
    return rows


def _read_npz(where: str) -> Lobes:
    with np.load(where, allow_pickle=False) as data:
        missing = [name for name in ("angles", "f", "sigma") if name not in data]
        if missing:
            raise FabricError(where, f"lacks {', '.join(missing)}; it must be a table of lobes")
        return _made(
            where, data["angles"], data["f"], data["sigma"],
            bool(data["absolute"]) if "absolute" in data else True,
            str(data["name"]) if "name" in data else Path(where).stem,
            tuple(str(note) for note in data["notes"]) if "notes" in data else (),
        )  # fmt: skip


def _made(
    where: str, angles: Floats, f: Floats, sigma: Floats, absolute: bool, name: str,
    notes: tuple[str, ...],
) -> Lobes:  # fmt: skip
    """Lobes from angles in degrees, once their ranges are checked."""
    if angles.ndim != 2 or angles.shape[1] != 3:
        raise FabricError(where, f"has angles of shape {angles.shape}; they must be (n, 3)")
    steep = np.abs(angles[:, :2]).max(axis=1) > 90.0
    if steep.any():
        row = angles[int(np.flatnonzero(steep)[0])]
        raise FabricError(
            where,
            f"has the inclinations {row[0]:g} and {row[1]:g} degrees; they must be from -90 to 90",
        )
    try:
        return Lobes(
            theta_i=angles[:, 0] * DEGREE, theta_o=angles[:, 1] * DEGREE,
            phi_d=folded(angles[:, 2] * DEGREE), f=np.asarray(f, np.float64),
            sigma=np.asarray(sigma, np.float64), absolute=absolute, name=name, notes=notes,
        )  # fmt: skip
    except FabricError as error:
        raise error.inside(where) from None


def described(lobes: Lobes) -> str:
    """How many views there are, and at which incidences."""
    unit = "absolute" if lobes.absolute else "relative"
    return f"{len(lobes)} views, {unit}, at incidences {listed(lobes.incidences)} degrees"
