"""The lobes, curves and colours of both sets of threads, from the light across a photograph.

Three things are fitted together: the light of squares of the picture, whose directions to lamp and
camera change across it; the contrast of the weave, and how it differs between channels; and, where
cloth was lit from behind, the colour of what came through. A photograph tells fewer numbers than
cloth has, so usual cloth pulls weakly at each (`USUAL`), and a number that the photograph does not
hold better than this pull is said to be assumed.

Squares are compared by cube roots, near to lightness as it is seen. The light of a lamp and a
camera that are known roughly is off by more than noise, alike in neighbouring squares: what is left
after a fit is taken as the deviation, of as many squares as are independent (`INDEPENDENT`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fabricusd.errors import FabricError
from fabricusd.fabric import FACETS, Fabric, TangentCurve, Thread, ThreadSet, Weave
from fabricusd.measure.angles import DEGREE
from fabricusd.measure.flat import law
from fabricusd.measure.flat.contrast import SlowContrast
from fabricusd.measure.flat.photograph import Photograph, squares
from fabricusd.measure.flat.setup import Setup, turned
from fabricusd.measure.flat.texture import Texture
from fabricusd.steps import parts

Floats = NDArray[np.float64]

IOR = 1.5
"""Of all fibres, within .06; one photograph without a card tells it from the lamp's power no more
than this."""
WIDER = 2.0
"""The volume lobe's width over the surface lobe's, [Sadeghi2013] Table II."""
SQUARES = 24
"""Squares along the shorter side of a picture."""
CLEARLY = 10.0
"""Difference of costs, half of chi^2, by which the light must speak for another face than the one
that was stated: errors of neighbouring squares are alike, so chi^2 says more than it knows."""
FEWEST = 60
"""Squares below which the light across a picture says too little."""
INDEPENDENT = 60
SLACK = 0.01
"""Added to light, over its mean, before cube roots: a phone's blacks are clipped."""
LEAST = 0.02
CHANNEL_ERROR, THROUGH_ERROR, CARD_ERROR = 0.15, 0.2, 0.03
SAME, SHADE = 3.0, 3.0
"""Usual difference between the sets, and usual spread, of logits of albedos."""
ROUNDS, STEPS = 2, 6
DARK = 0.004
"""Mean of a channel from behind, over that of the luminance, that counts as clipped."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One of the numbers that the light is not linear in; low to high is the range of the search,
    usual and spread are those of cloth."""

    label: str
    usual: float
    spread: float
    low: float
    high: float
    unit: str = "degrees"

    @property
    def scale(self) -> float:
        """SI value of the unit."""
        return DEGREE if self.unit else 1.0


PARAMETERS = tuple(
    Parameter(label=f"{which} {what}", usual=usual, spread=spread, low=low, high=high, unit=unit)
    for what, usual, spread, low, high, unit in (
        ("curve", 20.0, 10.0, 0.0, 45.0, "degrees"),
        ("gs", 15.0, 8.0, 3.0, 40.0, "degrees"),
        ("kd", 0.4, 0.3, 0.0, 1.0, ""),
    )
    for which in ("warp", "weft")
)
USUAL, SPREAD, LOW, HIGH = (
    np.array([getattr(p, name) * p.scale for p in PARAMETERS])
    for name in ("usual", "spread", "low", "high")
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Light:
    """Squares of one photograph: pairs (n, 3) to lamp and camera in the cloth's frame, (n,) squared
    distances of the lamp, (n, 3) light."""

    pairs: tuple[Floats, Floats]
    square: Floats
    light: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """What is fitted.

    front : the photograph lit from before; through : (3,) colour of the one lit from behind over
        its luminance, NaN where clipped, with `behind` its squares; or None
    gain : irradiance of the lamp at a distance of 1, if a card told it; else 0
    """

    weave: Weave
    frequencies: Floats
    gap: float
    front: Light
    texture: Texture
    middle: tuple[Floats, Floats]
    behind: Light | None = None
    through: Floats | None = None
    gain: float = 0.0
    density: tuple[float, float] = (2000.0, 2000.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Toned:
    """The fit. x : (6,) parameters; deviations : (6,); albedo, albedo_deviations : (2, 3)
    gain, gain_deviation : of the lamp, the latter relative; misfit : rms of the cube roots over
    the mean's; contrast : of the fitted weave; through : (3,) predicted colour, or None
    """

    fabric: Fabric
    x: Floats
    deviations: Floats
    albedo: Floats
    albedo_deviations: Floats
    gain: float
    gain_deviation: float
    misfit: float
    contrast: float
    through: Floats | None


def light_of(photograph: Photograph, setup: Setup, turn: float, *, behind: bool = False) -> Light:
    """The squares of a photograph; those in which the lamp itself may be seen are left out.

    Raises FabricError where too few squares are not saturated.
    """
    step = max(min(photograph.shape) // SQUARES, 1)
    light, _, good = squares(photograph, step)
    places = setup.places(photograph.shape, step)
    wi, wo, square = setup.pairs(places, behind=behind)
    if behind:
        good = good & ((wi * wo).sum(axis=1) > -math.cos(8 * DEGREE))
    if np.count_nonzero(good) < FEWEST:
        raise FabricError(
            f"'{photograph.name}'",
            f"has {np.count_nonzero(good)} of {good.size} squares without saturated pixels; there "
            f"must be at least {FEWEST}: expose for the cloth",
        )
    return Light(
        pairs=(turned(wi, turn)[good], turned(wo, turn)[good]), square=square[good],
        light=light[good],
    )  # fmt: skip


def through_color(light: Light) -> Floats:
    """(3,) logarithms of the channels' means over their mean; NaN where a channel is clipped."""
    mean = light.light.mean(axis=0)
    found = np.log(np.maximum(mean, 1e-9) / mean.mean())
    return np.where(mean < DARK * mean.mean() + 0.002, np.nan, found)


def cloth_of(task: Task, x: Floats) -> Fabric:
    """The fabric of parameters x, its threads white."""
    threads = {}
    for k, name in enumerate(law.NAMES):
        curve, gs, kd = float(x[k]), float(x[2 + k]), float(x[4 + k])
        threads[name] = Thread(
            albedo=(1, 1, 1), ior=IOR, isotropic=kd, gamma_surface=gs,
            gamma_volume=min(WIDER * gs, 1.5), curve=TangentCurve(angles=(-curve, curve)),
        )  # fmt: skip
    share = task.weave.warp_share
    covered = 1.0 - task.gap
    return Fabric(
        name="Flat", threads=threads, weave=task.weave, model="conserving", surface_law=FACETS,
        warp=ThreadSet(sequence=(0,), density=task.density[0], coverage=share * covered),
        weft=ThreadSet(sequence=(1,), density=task.density[1], coverage=(1 - share) * covered),
    )  # fmt: skip


class Search:
    """Residuals of a task about one balance of the cloth's light by side."""

    def __init__(self, task: Task, x: Floats, linear: Floats, sigma: float) -> None:
        self.task, self.linear = task, linear
        self.known = law.balance(cloth_of(task, x))
        front = task.front
        self.level = front.light.mean()
        self.target = self.root(front.light)
        self.weight = math.sqrt(INDEPENDENT / self.target.size) / sigma
        self.slow = SlowContrast(task.texture.waves)

    def root(self, light: Floats) -> Floats:
        """Cube roots, 1 for the mean."""
        return np.asarray(np.cbrt(np.maximum(light / self.level, 0.0) + SLACK))

    def parts(self, x: Floats) -> tuple[Any, ...]:
        """What does not depend on colours: columns before, patch, columns behind, shades."""
        task, fabric = self.task, cloth_of(self.task, x)
        behind = None
        if task.behind is not None:
            every = slice(None, None, 7)
            pairs = (task.behind.pairs[0][every], task.behind.pairs[1][every])
            behind = law.columns(fabric, self.known, pairs)
        return (
            law.columns(fabric, self.known, task.front.pairs),
            law.patch(fabric, self.known, task.middle, task.frequencies),
            behind,
            law.shades(fabric, self.known.escape),
        )

    def terms(self, made: tuple[Any, ...], z: Floats) -> tuple[Floats, Floats]:
        """(residuals of squares, all others) for logits of albedos and the gain's logarithm z."""
        task = self.task
        front, patch, behind, shade = made
        albedo = 1.0 / (1.0 + np.exp(-z[:6].reshape(2, 3)))
        gain = math.exp(float(z[6]))
        light = gain * law.radiance(front, albedo, shade) / task.front.square[:, None]
        texture = task.texture
        seen, slopes = self.slow(law.patch_radiance(patch, albedo, shade))
        clear = np.isfinite(texture.channels)
        others = [
            np.array([math.log(max(seen, 1e-4) / texture.slow) / texture.slow_error]),
            (slopes - texture.channels)[clear] / CHANNEL_ERROR,
            (z[:3] - z[3:6]) / SAME,
            z[:6] / SHADE,
        ]
        if behind is not None and task.through is not None:
            clear = np.isfinite(task.through)
            others.append((self.through(made, albedo) - task.through)[clear] / THROUGH_ERROR)
        if task.gain > 0:
            others.append(np.array([(z[6] - math.log(task.gain)) / CARD_ERROR]))
        return ((self.root(light) - self.target) * self.weight).ravel(), np.concatenate(others)

    def through(self, made: tuple[Any, ...], albedo: Floats) -> Floats:
        """(3,) predicted `through_color`."""
        _, _, behind, shade = made
        assert self.task.behind is not None
        light = law.radiance(behind, albedo, shade) / self.task.behind.square[::7, None]
        mean = light.mean(axis=0)
        return np.asarray(np.log(np.maximum(mean, 1e-9) / mean.mean()))

    def solve(self, made: tuple[Any, ...]) -> Any:
        """The best colours and gain."""
        found = least_squares(
            lambda z: np.concatenate(self.terms(made, z)), self.linear, max_nfev=25
        )
        self.linear = found.x
        return found

    def residuals(self, x: Floats) -> Floats:
        """All residuals for parameters x, colours and gain at their best."""
        return np.concatenate((self.solve(self.parts(x)).fun, (x - USUAL) / SPREAD))


def fit_faces(tasks: list[Task]) -> tuple[int, Toned]:
    """(index of the task that the light agrees with best, its fit): a first round for each, and
    another for the best. The first is kept unless another is clearly better."""
    tried = []
    for k in parts("faces", range(len(tasks))):
        tried.append(_round(tasks[k], *_start(tasks[k])))
    best = min(range(len(tasks)), key=lambda k: tried[k].cost)
    if tried[0].cost - tried[best].cost < CLEARLY:
        best = 0
    return best, fit_tones(tasks[best], tried[best])


class Round(NamedTuple):
    """What a round of the search leaves: its search, parameters, colours, misfit and cost."""

    search: Search
    x: Floats
    linear: Floats
    misfit: float
    cost: float


def _start(task: Task) -> tuple[Floats, Floats, float]:
    linear = np.append(np.zeros(6), math.log(task.gain) if task.gain > 0 else 1.0)
    return USUAL.copy(), linear, 0.1


def _round(task: Task, x: Floats, linear: Floats, sigma: float) -> Round:
    """Search about the balance of light of the cloth that x stands for."""
    search = Search(task, x, linear, sigma)
    inner = 1e-3 * (HIGH - LOW)
    done = least_squares(
        search.residuals, np.clip(x, LOW + inner, HIGH - inner), bounds=(LOW, HIGH),
        x_scale=SPREAD, diff_step=1e-2, max_nfev=STEPS,
    )  # fmt: skip
    made = search.parts(done.x)
    search.solve(made)
    left, _ = search.terms(made, search.linear)
    misfit = float(np.sqrt(np.mean((left / search.weight) ** 2)))
    return Round(search, done.x, search.linear, misfit, float(done.cost))


def fit_tones(task: Task, first: Round | None = None) -> Toned:
    """Search, balance anew, and search again; see the module. first : a round that was made"""
    done = first or _round(task, *_start(task))
    for _ in parts("tones", range(ROUNDS - 1)):
        done = _round(task, done.x, done.linear, max(done.misfit, LEAST))
    return _toned(done.search, done.x, done.search.parts(done.x), done.misfit)


def _toned(search: Search, x: Floats, made: tuple[Any, ...], misfit: float) -> Toned:
    """Intervals from the curvature of all residuals by all numbers together."""
    z = search.linear

    def every(q: Floats) -> Floats:
        terms = search.terms(search.parts(q[:6]), q[6:])
        return np.concatenate((*terms, (q[:6] - USUAL) / SPREAD))

    q = np.concatenate((x, z))
    start = every(q)
    step = np.concatenate((1e-2 * SPREAD, np.full(7, 1e-3)))
    jacobian = np.empty((len(start), len(q)))
    for k in range(len(q)):
        moved = q.copy()
        sign = -1.0 if k < 6 and x[k] + step[k] > HIGH[k] else 1.0
        moved[k] += sign * step[k]
        if k < 6:
            jacobian[:, k] = (every(moved) - start) / (sign * step[k])
        else:
            terms = search.terms(made, moved[6:])
            rise = np.concatenate((*terms, (x - USUAL) / SPREAD)) - start
            jacobian[:, k] = rise / step[k]
    deviations = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    albedo = 1.0 / (1.0 + np.exp(-z[:6].reshape(2, 3)))
    shade = made[3]
    seen, _ = search.slow(law.patch_radiance(made[1], albedo, shade))
    fabric = law.white_pair(cloth_of(search.task, x), tuple(albedo[0]), tuple(albedo[1]))
    return Toned(
        fabric=fabric, x=x, deviations=deviations[:6], albedo=albedo,
        albedo_deviations=deviations[6:12].reshape(2, 3) * albedo * (1 - albedo),
        gain=math.exp(float(z[6])), gain_deviation=float(deviations[12]), misfit=misfit,
        contrast=seen, through=None if made[2] is None else search.through(made, albedo),
    )  # fmt: skip
