"""Least squares of lobes against a thread model, what is linear eliminated (variable projection).

`f = gain surface + gain A volume + offset` per channel. For given nonlinear parameters, the gain
that all channels share, the albedos and the offsets follow from a linear solve, so the search has
four dimensions, five with a lean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.scattering.models import named
from fabricusd.appearance.thread import split
from fabricusd.measure.angles import tilted
from fabricusd.measure.fit.parameters import Parameter, thread_of
from fabricusd.measure.lobes import Lobes

Floats = NDArray[np.float64]

SMALLEST_GAIN = 1e-6
PASSES = 4
"""Rounds in which albedos outside of their range are held at its ends."""


@dataclass(frozen=True, kw_only=True)
class Linear:
    """What follows from the nonlinear parameters: gain, (3,) albedo, (3,) offset [1/sr]."""

    gain: float
    albedo: Floats
    offset: Floats


class Problem:
    """Lobes and a model: residuals for parameters.

    names : the nonlinear parameters, in the order of a vector x
    gain, offset : whether a common factor and a constant per channel are fitted too
    """

    def __init__(
        self, lobes: Lobes, model: str, names: tuple[Parameter, ...], *, gain: bool, offset: bool
    ) -> None:
        self.lobes, self.model, self.names = lobes, model, names
        self.gain, self.offset = gain, offset
        self.weight = 1.0 / lobes.sigma
        self.target = lobes.f * self.weight
        self.wi, self.wo = lobes.wi, lobes.wo
        self.most = named(model).most_albedo

    @property
    def low(self) -> Floats:
        """(k,) lower bounds."""
        return np.array([p.low for p in self.names])

    @property
    def high(self) -> Floats:
        """(k,) upper bounds."""
        return np.array([p.high for p in self.names])

    @property
    def steps(self) -> Floats:
        """(k,) usual changes, by which an optimiser scales."""
        return np.array([p.step for p in self.names])

    @property
    def freedom(self) -> int:
        """Values less parameters."""
        linear = 3 + int(self.gain) + 3 * int(self.offset)
        return max(self.target.size - len(self.names) - linear, 1)

    def terms(self, x: Floats) -> tuple[Floats, Floats]:
        """(n,) surface and (n,) volume term [1/sr] for parameters x."""
        wi, wo = self.wi, self.wo
        if self.names[-1].name == "lean":
            wi, wo = tilted(wi, float(x[-1])), tilted(wo, float(x[-1]))
        return split(thread_of(self.names, x), wi, wo, self.model)

    def solve(self, x: Floats) -> tuple[Floats, Linear]:
        """((n, 3) weighted residuals, what is linear) for parameters x."""
        surface, volume = self.terms(x)
        linear = self._linear(surface, volume)
        return self._residual(surface, volume, linear), linear

    def residuals(self, x: Floats) -> Floats:
        """(3n,) weighted residuals, the linear part at its best."""
        return self.solve(x)[0].ravel()

    def residuals_at(self, x: Floats, linear: Linear) -> Floats:
        """(3n,) weighted residuals for a linear part that is given."""
        surface, volume = self.terms(x)
        return self._residual(surface, volume, linear).ravel()

    def _residual(self, surface: Floats, volume: Floats, linear: Linear) -> Floats:
        f = linear.gain * (surface[:, None] + volume[:, None] * linear.albedo) + linear.offset
        return f * self.weight - self.target

    def _linear(self, surface: Floats, volume: Floats) -> Linear:
        """The best gain, albedos and offsets within their ranges."""
        held: list[float | None] = [None, None, None]
        gain, a, b = 1.0, np.zeros(3), np.zeros(3)
        for _ in range(PASSES):
            systems = [self._channel(c, surface, volume, held[c]) for c in range(3)]
            if self.gain:
                above = sum(float(s @ y) for s, y, _ in systems)
                below = sum(float(s @ s) for s, _, _ in systems)
                gain = max(above / below, SMALLEST_GAIN) if below > 0 else 1.0
            for c, (_, _, back) in enumerate(systems):
                a[c], b[c] = back(gain)
            albedo = a / gain
            outside = [
                c for c in range(3)
                if held[c] is None and not -1e-12 <= albedo[c] <= self.most * (1 + 1e-12)
            ]  # fmt: skip
            if not outside:
                break
            for c in outside:
                held[c] = 0.0 if albedo[c] < 0 else self.most
        return Linear(gain=gain, albedo=np.clip(a / gain, 0.0, self.most), offset=b)

    def _channel(
        self, c: int, surface: Floats, volume: Floats, held: float | None
    ) -> tuple[Floats, Floats, Any]:
        """One channel's surface and target without what its own unknowns can explain.

        held : an albedo that is fixed, whose volume term then belongs to the surface

        Returns (surface (n,), target (n,), gain -> (gain albedo, offset)).
        """
        w = self.weight[:, c]
        s, y = surface * w, self.target[:, c]
        columns = []
        if held is None:
            columns.append(volume * w)
        else:
            s = s + held * volume * w
        if self.offset:
            columns.append(w)
        if not columns:
            return s, y, lambda gain: (gain * float(held or 0.0), 0.0)
        basis = np.stack(columns, axis=1)
        scale = np.linalg.norm(basis, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        q, r = np.linalg.qr(basis / scale)
        diagonal = np.abs(np.diag(r))
        q = q * (diagonal > 1e-10)
        own_s, own_y = q.T @ s, q.T @ y

        def back(gain: float) -> tuple[float, float]:
            found = np.linalg.lstsq(r, own_y - gain * own_s, rcond=1e-10)[0] / scale
            a = gain * held if held is not None else float(found[0])
            return float(a), float(found[-1]) if self.offset else 0.0

        return s - q @ own_s, y - q @ own_y, back
