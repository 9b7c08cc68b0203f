"""What a woven fabric is: threads, the tangent curve along them, the weave, the thread sets.

Plain immutable values in SI units and radians, independent of USD. `fabricusd.schema` reads and
writes them; `fabricusd.appearance` compiles them. Conventions are those of MODEL, sections 1 and 3
(`docs/model.md`): end `i` counts along +U, pick `j` along +V, both from 0; warp runs along V.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from importlib import import_module
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.sides import UNSTATED, Sides

MODELS = ("thesis", "microcylinder", "conserving")
"""Thread scattering models; each is a module of that name in `appearance/scattering/models` and a
token of the schema. A model's number is its index here, so new models are appended."""

FACETS = "facets"
SURFACE_LAWS = ("masked", "unmasked", "projected", "visible", FACETS)
"""Laws by which light on threads becomes light on cloth. The first is the default. Those of
published threads are modules of that name in `appearance/laws`; FACETS is the law of
`conserving` threads."""

DEFAULT_MODEL = "microcylinder"
CONSERVING_MODEL = MODELS[-1]

BASES = ("none", "opaque", "singleLayer")
"""What a thread's target colour is the colour of: nothing, cloth of it folded until opaque, or one
layer of cloth of it over black."""

OBSERVERS = (2, 10)
"""Field of view of the CIE standard observers [degrees]."""
PILE_ANGLE = math.radians(85.0)
"""A curve steeper than this is pile: it stands up from the cloth and has no height field."""

DEGREE = math.pi / 180.0


def _limits(
    minimum: float | None = None,
    maximum: float | None = None,
    *,
    above: float | None = None,
    below: float | None = None,
    radians: bool = False,
) -> Mapping[str, Any]:
    """Field metadata: the closed (`minimum`, `maximum`) and open (`above`, `below`) bounds, and
    whether the field is an angle in radians."""
    return MappingProxyType(
        {
            "minimum": minimum, "maximum": maximum, "above": above, "below": below,
            "radians": radians,
        }
    )  # fmt: skip


def describe_limits(limits: Mapping[str, Any], scale: float = 1.0, unit: str = "") -> str:
    """The accepted range in words: `at least 1`, `from 0 to 1`, `above 0 and below 90 degrees`."""
    words = []
    lo, hi = limits.get("minimum"), limits.get("maximum")
    if lo is not None and hi is not None:
        words.append(f"from {lo * scale:.6g} to {hi * scale:.6g}")
    elif lo is not None:
        words.append(f"at least {lo * scale:.6g}")
    elif hi is not None:
        words.append(f"at most {hi * scale:.6g}")
    if limits.get("above") is not None:
        words.append(f"above {limits['above'] * scale:.6g}")
    if limits.get("below") is not None:
        words.append(f"below {limits['below'] * scale:.6g}")
    return " and ".join(words) + (f" {unit}" if unit else "")


def within_limits(value: float, limits: Mapping[str, Any]) -> bool:
    """Whether `value` is a finite number inside `limits`."""
    if not math.isfinite(value):
        return False
    lo, hi = limits.get("minimum"), limits.get("maximum")
    above, below = limits.get("above"), limits.get("below")
    return not (
        (lo is not None and value < lo)
        or (hi is not None and value > hi)
        or (above is not None and value <= above)
        or (below is not None and value >= below)
    )


def _require_limits(owner: Any) -> None:
    """Raise `FabricError` for the first field of `owner` outside the bounds in its metadata."""
    for f in fields(owner):
        if not f.metadata:
            continue
        value = getattr(owner, f.name)
        if value is None:
            continue
        for number in value if isinstance(value, tuple) else (value,):
            if not within_limits(number, f.metadata):
                if f.metadata.get("radians"):
                    limits = describe_limits(f.metadata, unit="radians")
                    raise FabricError(
                        f.name, f"is {number!r} radians; it must be {limits}{_if_degrees(number)}"
                    )
                raise FabricError(
                    f.name, f"is {number!r}; it must be {describe_limits(f.metadata)}"
                )


def _if_degrees(number: float) -> str:
    """What an angle is in radians that was probably given in degrees, or ""."""
    if not 1.5 < abs(number) <= 360.0:
        return ""
    return f"; {number:g}° is {math.radians(number):.3g}"


@dataclass(frozen=True, kw_only=True)
class TangentCurve:
    """Tangent angle against position along one visible run of a thread.

    positions : (n,) float, n >= 2 - never decreasing; two equal positions make a jump. Only their
        proportions matter: each run of equal cells is spanned by the whole curve once.
    angles : (n,) float - tangent angle psi0 [rad], from -pi/2 to pi/2; a positive angle leans the
        thread's normal forward along its axis. Linear between the points.

    Source: [Bisker2011] section 5.2.1.
    """

    positions: tuple[float, ...] = (0.0, 1.0)
    angles: tuple[float, ...] = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", tuple(float(p) for p in self.positions))
        object.__setattr__(self, "angles", tuple(float(a) for a in self.angles))
        p, a = self.positions, self.angles
        if len(p) != len(a):
            raise FabricError(
                "curve", f"has {len(p)} positions and {len(a)} angles; it must have as many of each"
            )
        if len(p) < 2:
            raise FabricError("curve", f"has {len(p)} points; it must have at least 2")
        for k, x in enumerate(p):
            if not math.isfinite(x):
                raise FabricError(f"curve position {k}", f"is {x}; it must be finite")
            if k and x < p[k - 1]:
                raise FabricError(
                    f"curve position {k}",
                    f"is {x}; it must be at least {p[k - 1]}, the position before it",
                )
        if not p[-1] > p[0]:
            raise FabricError("curve", f"spans {p[0]} to {p[-1]}; it must have a length above 0")
        for k, x in enumerate(a):
            if not (math.isfinite(x) and abs(x) <= math.pi / 2 + 1e-12):
                raise FabricError(
                    f"curve angle {k}",
                    f"is {x:.6g} radians; it must be from -1.5708 to 1.5708 radians"
                    f"{_if_degrees(x)}",
                )

    @classmethod
    def from_lengths(cls, angles: Iterable[float], lengths: Iterable[float]) -> TangentCurve:
        """A curve from tangent angles [rad] and the lengths *between* them, as papers print it."""
        steps = [float(x) for x in lengths]
        if any(not x >= 0 for x in steps):
            raise FabricError("curve length", f"is {min(steps)}; it must be at least 0")
        return cls(positions=(0.0, *(float(x) for x in np.cumsum(steps))), angles=tuple(angles))

    @property
    def steepest(self) -> float:
        """The largest |angle| [rad]."""
        return max(abs(a) for a in self.angles)

    @property
    def is_straight(self) -> bool:
        """Whether the thread lies flat everywhere."""
        return self.steepest == 0.0


UNEVENNESS = (
    "unevenness_cv", "unevenness_length", "unevenness_count", "unevenness_shade",
    "slub_amount", "slub_length", "slub_spacing",
)  # fmt: skip
"""Fields of a `Thread` that are 0 where it is as even as a wire."""


def yarn_faults(
    *,
    unevenness_cv: float,
    unevenness_length: float,
    unevenness_shade: float,
    slub_amount: float,
    slub_length: float,
    slub_spacing: float,
    unevenness_count: float = 0.0,
    scale: float = 1.0,
    unit: str = "m",
) -> list[tuple[str, str]]:
    """(field, problem) of numbers that are sound one by one but contradict one another.

    scale, unit : in which the lengths are written in the message
    """
    faults = []
    if unevenness_length == 0:
        for name, value in (("cv", unevenness_cv), ("shade", unevenness_shade)):
            if value > 0:
                said = f"is 0; it must be above 0 {unit}, since the {name} is {value:g}"
                faults.append(("unevenness_length", said))
                break
    if slub_amount > 0 and slub_length == 0:
        said = f"is 0; it must be above 0 {unit}, since the slubs' amount is {slub_amount:g}"
        faults.append(("slub_length", said))
    elif slub_amount > 0 and slub_spacing < slub_length:
        said = f"is {slub_spacing * scale:g}; it must be at least {slub_length * scale:g} {unit}"
        faults.append(("slub_spacing", f"{said}, the length of a slub"))
    return faults


@dataclass(frozen=True, kw_only=True)
class Thread:
    """A type of thread: how it scatters, how thick it is, how it bends where it is on top.

    albedo : (3,) float - MODEL's `A`, linear Rec. 709; a true albedo only in the `conserving` model
    ior : float - `eta`, at least 1
    isotropic : float - `kd`, isotropic share of the volume scattering, 0 to 1
    gamma_surface, gamma_volume : float - lobe standard deviations `gs`, `gv` [rad]
    surface_gain : float - `ks`, factor on the surface reflectance (`conserving` only)
    thickness : float - visible width [m]; 0 if unknown
    linear_density : float - mass per length [kg/m], the yarn's count; 0 if unknown
    curve : TangentCurve
    model : str - one of MODELS, or "" for that of the fabric
    color : (3,) float - its colour in a draft, linear Rec. 709; rendering does not use it
    target_color : (3,) float - colour of cloth of it that `albedo` was solved for, linear Rec. 709;
        below 0 outside of that gamut. Rendering does not use it
    target_basis : str - one of BASES; "none" where `albedo` was not solved for
    target_observer : int - one of OBSERVERS, that the colour was given for
    unevenness_cv : float - CVm, the coefficient of variation of the mass of pieces 8 mm long; the
        width varies by half of it
    unevenness_length : float - distance along the thread over which thickness and shade change [m];
        above 0 where either varies
    unevenness_count : float - coefficient of variation of the mass from one thread to the next
    unevenness_shade : float - standard deviation of the albedo along and between threads, over the
        albedo
    slub_amount : float - how much wider a thread is in the middle of a slub, on average, over its
        width; slub_length, slub_spacing : float - length of a slub, and distance from one to the
        next [m]
    plies : int - yarns that are twisted together into the thread; 1 for single yarn
    twist : float - turns of the plies [1/m], Z above 0, S below
    hairiness : float - Uster's H of the yarn in the finished cloth: length of the fibres that
        protrude from it, over its own length
    documentation : str - where the numbers come from
    """

    albedo: tuple[float, float, float] = field(default=(0.2, 0.2, 0.2), metadata=_limits(0.0))
    ior: float = field(default=1.5, metadata=_limits(1.0))
    isotropic: float = field(default=0.3, metadata=_limits(0.0, 1.0))
    gamma_surface: float = field(
        default=12 * DEGREE, metadata=_limits(above=0.0, maximum=math.pi, radians=True)
    )
    gamma_volume: float = field(
        default=24 * DEGREE, metadata=_limits(above=0.0, maximum=math.pi, radians=True)
    )
    surface_gain: float = field(default=1.0, metadata=_limits(0.0))
    thickness: float = field(default=0.0, metadata=_limits(0.0))
    linear_density: float = field(default=0.0, metadata=_limits(0.0))
    curve: TangentCurve = TangentCurve()
    model: str = ""
    color: tuple[float, float, float] = field(default=(0.5, 0.5, 0.5), metadata=_limits(0.0))
    target_color: tuple[float, float, float] = field(
        default=(0.5, 0.5, 0.5), metadata=_limits(-10.0, 10.0)
    )
    target_basis: str = BASES[0]
    target_observer: int = OBSERVERS[0]
    unevenness_cv: float = field(default=0.0, metadata=_limits(0.0, 1.0))
    unevenness_length: float = field(default=0.0, metadata=_limits(0.0))
    unevenness_count: float = field(default=0.0, metadata=_limits(0.0, 1.0))
    unevenness_shade: float = field(default=0.0, metadata=_limits(0.0, 1.0))
    slub_amount: float = field(default=0.0, metadata=_limits(0.0, 4.0))
    slub_length: float = field(default=0.0, metadata=_limits(0.0))
    slub_spacing: float = field(default=0.0, metadata=_limits(0.0))
    plies: int = field(default=1, metadata=_limits(1, 12))
    twist: float = field(default=0.0, metadata=_limits(-20000.0, 20000.0))
    hairiness: float = field(default=0.0, metadata=_limits(0.0, 100.0))
    documentation: str = ""

    def __post_init__(self) -> None:
        for name in ("albedo", "color", "target_color"):
            value = tuple(float(x) for x in getattr(self, name))
            if len(value) != 3:
                raise FabricError(name, f"has {len(value)} numbers; it must have 3")
            object.__setattr__(self, name, value)
        for name in (
            "ior", "isotropic", "gamma_surface", "gamma_volume", "surface_gain", "thickness",
            "linear_density", *UNEVENNESS, "twist", "hairiness",
        ):  # fmt: skip
            object.__setattr__(self, name, float(getattr(self, name)))
        if self.plies != int(self.plies):
            raise FabricError("plies", f"is {self.plies!r}; it must be a whole number")
        object.__setattr__(self, "plies", int(self.plies))
        _require_limits(self)
        for name, problem in yarn_faults(**{name: getattr(self, name) for name in UNEVENNESS}):
            raise FabricError(name, problem)
        if self.model and self.model not in MODELS:
            raise FabricError("model", f"is '{self.model}'; it must be one of {', '.join(MODELS)}")
        for name, allowed in (("target_basis", BASES), ("target_observer", OBSERVERS)):
            if getattr(self, name) not in allowed:
                words = ", ".join(str(x) for x in allowed)
                raise FabricError(name, f"is '{getattr(self, name)}'; it must be one of {words}")

    @property
    def is_uneven(self) -> bool:
        """Whether its width or its shade varies, or its plies show."""
        return (
            max(self.unevenness_cv, self.unevenness_count, self.unevenness_shade) > 0
            or self.slub_amount > 0
            or self.shows_plies
        )

    @property
    def shows_plies(self) -> bool:
        """Whether it is of several yarns that wind round one another."""
        return self.plies > 1 and self.twist != 0


@dataclass(frozen=True, eq=False)
class Weave:
    """Which thread is on top at each crossing.

    cells : (m, n) bool - `cells[i, j]` is True where end `i` (along +U) lies over pick `j`
        (along +V). Stored as a read-only copy, or as it is if the array is already read-only.
    name : str - how it was made, for people to read: "satin 5 step 2", "8452.wif"
    """

    cells: NDArray[np.bool_]
    name: str = ""

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells, order="C")
        if cells.flags.writeable:
            cells = cells.copy()
        if cells.ndim != 2 or cells.size == 0:
            raise FabricError(
                "weave", f"has shape {cells.shape}; it must have at least one end and one pick"
            )
        if cells.dtype != np.bool_:
            if not np.isin(cells, (0, 1)).all():
                raise FabricError("weave", "has cells other than 0 (weft on top) and 1 (warp)")
            cells = cells.astype(np.bool_)
        cells.flags.writeable = False
        object.__setattr__(self, "cells", cells)

    @property
    def ends(self) -> int:
        """Warp threads in the repeat, `m`."""
        return int(self.cells.shape[0])

    @property
    def picks(self) -> int:
        """Weft threads in the repeat, `n`."""
        return int(self.cells.shape[1])

    @property
    def warp_share(self) -> float:
        """Share of the cells with warp on top, `c_warp`."""
        return float(np.count_nonzero(self.cells)) / self.cells.size

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Weave):
            return NotImplemented
        return self.name == other.name and np.array_equal(self.cells, other.cells)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        # Cached, like the shares below: a 4096 x 4096 jacquard has 16 million cells.
        return hash((self.cells.shape, self.cells.tobytes(), self.name))

    @cached_property
    def shares_on_top(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(m,) and (n,): the share of each end's, and of each pick's, cells where it is on top."""
        return self.cells.mean(axis=1), 1.0 - self.cells.mean(axis=0)


@dataclass(frozen=True, kw_only=True)
class ThreadSet:
    """The warp or the weft: the order of its threads, how close they lie, what they cover.

    sequence : (k,) int - indices into `Fabric.threads`, repeated across the cloth: end `i` has the
        thread `sequence[i % k]`
    density : float - threads per metre
    coverage : float or None - share `a` of the cloth's area that the set covers; None derives it
        from the weave and the thickness of the threads
    """

    sequence: tuple[int, ...] = (0,)
    density: float = field(default=2000.0, metadata=_limits(above=0.0))
    coverage: float | None = field(default=None, metadata=_limits(0.0, 1.0))

    def __post_init__(self) -> None:
        object.__setattr__(self, "sequence", tuple(int(k) for k in self.sequence))
        object.__setattr__(self, "density", float(self.density))
        if self.coverage is not None:
            object.__setattr__(self, "coverage", float(self.coverage))
        if not self.sequence:
            raise FabricError("sequence", "is empty; it must name at least one thread")
        _require_limits(self)

    @property
    def pitch(self) -> float:
        """Distance between the middles of neighbouring threads [m]."""
        return 1.0 / self.density


@dataclass(frozen=True, kw_only=True)
class Fabric:
    """A woven fabric.

    threads : name -> Thread, in the order in which `ThreadSet.sequence` counts them
    weave : Weave
    warp, weft : ThreadSet - warp runs along V, weft along U
    model : str - one of MODELS, for every thread that does not name one
    surface_law : str - one of SURFACE_LAWS: how light on threads becomes light on cloth.
        `conserving` threads follow "facets" whatever it is, and threads of other models cannot
    opaque : bool - whether it lets no light through: cloth with a backing, or pile
    sides : Sides - where its light goes (`conserving` only)
    unevenness_seed : int - chooses one of many cloths whose uneven threads are alike
    masking_width : float - standard deviation of `u`, the correlation of shadowing and masking in
        azimuth [rad]; 20 degrees in [Sadeghi2013]
    back : Fabric or None - the other side, if it is a fabric of its own; None mirrors this one
    documentation : str - where the numbers come from
    """

    name: str = "Fabric"
    threads: Mapping[str, Thread] = field(default_factory=lambda: {"Thread": Thread()})
    weave: Weave = field(default_factory=lambda: Weave(np.eye(2, dtype=bool), "plain"))
    warp: ThreadSet = ThreadSet()
    weft: ThreadSet = ThreadSet()
    model: str = DEFAULT_MODEL
    surface_law: str = SURFACE_LAWS[0]
    opaque: bool = False
    sides: Sides = UNSTATED
    masking_width: float = field(
        default=20 * DEGREE, metadata=_limits(above=0.0, maximum=2 * math.pi, radians=True)
    )
    unevenness_seed: int = field(default=0, metadata=_limits(0, 2**31 - 1))
    back: Fabric | None = None
    documentation: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "threads", MappingProxyType(dict(self.threads)))
        if not self.threads:
            raise FabricError("threads", "is empty; a fabric must have at least one thread")
        if self.model not in MODELS:
            raise FabricError("model", f"is '{self.model}'; it must be one of {', '.join(MODELS)}")
        if self.surface_law not in SURFACE_LAWS:
            raise FabricError(
                "surface_law",
                f"is '{self.surface_law}'; it must be one of {', '.join(SURFACE_LAWS)}",
            )
        if self.surface_law == FACETS:
            for name, thread in self.threads.items():
                if self.model_of(thread) != MODELS[-1]:
                    raise FabricError(
                        "surface_law",
                        f"is '{FACETS}', the law of {MODELS[-1]} threads, but the model of thread "
                        f"'{name}' is {self.model_of(thread)}; it must be one of "
                        f"{', '.join(SURFACE_LAWS[:-1])}",
                    )
        _require_limits(self)
        for label, thread_set in (("warp", self.warp), ("weft", self.weft)):
            for k, index in enumerate(thread_set.sequence):
                if not 0 <= index < len(self.threads):
                    raise FabricError(
                        f"{label} thread {k}",
                        f"is {index}; it must be from 0 to {len(self.threads) - 1}, since "
                        f"the fabric has {len(self.threads)} thread(s)",
                    )
        total = (self.warp.coverage or 0.0) + (self.weft.coverage or 0.0)
        if total > 1.0 + 1e-9:
            raise FabricError(
                "coverage", f"of warp and weft together is {total:.6g}; it must be at most 1"
            )
        if self.back is not None and self.back.back is not None:
            raise FabricError(
                "back", "names a fabric that has a back of its own; it must name one that has none"
            )

    @property
    def thread_list(self) -> tuple[Thread, ...]:
        """The threads in index order."""
        return tuple(self.threads.values())

    @property
    def is_uneven(self) -> bool:
        """Whether any thread's width or shade varies, or its plies show."""
        return any(t.is_uneven for t in self.threads.values())

    def model_of(self, thread: Thread) -> str:
        """The scattering model that `thread` is evaluated with in this fabric."""
        return thread.model or self.model

    def __hash__(self) -> int:
        return hash((self.name, tuple(self.threads.items()), self.weave, self.warp, self.weft))

    def _repr_png_(self) -> bytes:
        """The fabric as notebooks show it: a PNG of a cylinder of it, made when it is asked for."""
        # By name: `preview` rests on this module.
        shown: bytes = import_module("fabricusd.preview.picture").thumbnail(self)
        return shown


def even(fabric: Fabric) -> Fabric:
    """`fabric` of threads that are as even as wires, and so is its back."""
    wires: dict[str, Any] = {**dict.fromkeys(UNEVENNESS, 0.0), "plies": 1, "twist": 0.0}
    return replace(
        fabric,
        threads={name: replace(t, **wires) for name, t in fabric.threads.items()},
        back=None if fabric.back is None else even(fabric.back),
    )


@dataclass(frozen=True, kw_only=True)
class Binding:
    """How a fabric lies on a mesh: by which UVs, at which scale, with which rotation and offset.

    fabric : Fabric
    uv_set : str - name of the texture coordinate primvar
    metres_per_uv : float - length of one UV unit on the cloth [m]; 0 to measure it from the mesh
    threads_per_uv : (2,) float - (ends per unit of u, picks per unit of v); if not 0, they take
        precedence over `metres_per_uv`
    rotation : float - of the grain, from the mesh's u axis to the weft, counter-clockwise [rad]
    offset : (2,) float - in units of UV, added after the rotation
    """

    fabric: Fabric
    uv_set: str = "st"
    metres_per_uv: float = field(default=0.0, metadata=_limits(0.0))
    threads_per_uv: tuple[float, float] = field(default=(0.0, 0.0), metadata=_limits(0.0))
    rotation: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _require_limits(self)
        if (self.threads_per_uv[0] == 0) != (self.threads_per_uv[1] == 0):
            raise FabricError(
                "threads_per_uv", f"is {self.threads_per_uv}; set both numbers, or neither"
            )

    def weave_coordinates(
        self, uv: NDArray[np.float64], metres_per_uv: float = 0.0
    ) -> NDArray[np.float64]:
        """(n, 2) UV -> (n, 2) float64 weave coordinates in threads: (ends along U, picks along V).

        `metres_per_uv` is the scale measured on the mesh; it is used if the binding states none.
        """
        c, s = math.cos(self.rotation), math.sin(self.rotation)
        uv = np.asarray(uv, np.float64)
        # To turn the grain by +rotation, read the weave at the UV turned by -rotation.
        u = c * uv[..., 0] + s * uv[..., 1] + self.offset[0]
        v = -s * uv[..., 0] + c * uv[..., 1] + self.offset[1]
        scale_u, scale_v = self.threads_per_uv
        if not scale_u:
            metres = self.metres_per_uv or metres_per_uv
            if not metres > 0:
                raise FabricError("metres_per_uv", f"is {metres}; it must be above 0")
            scale_u, scale_v = metres * self.fabric.warp.density, metres * self.fabric.weft.density
        return np.stack((u * scale_u, v * scale_v), axis=-1)


_ANY_WEAVE = Weave(np.eye(2, dtype=bool))


def one_side(fabric: Fabric) -> tuple[str, NDArray[np.bool_]]:
    """What tables of one side of `fabric` depend on, as `cache.kept` takes it: all but its back and
    its words."""
    with np.printoptions(legacy=False):
        said = repr(replace(fabric, weave=_ANY_WEAVE, back=None, documentation=""))
    return said, fabric.weave.cells
