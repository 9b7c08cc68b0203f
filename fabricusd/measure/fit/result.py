"""What a fit gives: the thread, intervals of its numbers, and what could not be told apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from fabricusd.fabric import Thread


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A number with its 95 % interval.

    label : of a report; value, low, high : in `unit`
    open_low, open_high : whether the interval ends where the search ends, not where the data say
    how : "curvature", "profile", or "bound" for what lies at the end of its range
    """

    label: str
    value: float
    low: float
    high: float
    unit: str = ""
    how: str = "curvature"
    open_low: bool = False
    open_high: bool = False

    @property
    def spread(self) -> float:
        """Width of the interval over the value; infinite for 0."""
        return (self.high - self.low) / abs(self.value) if self.value else math.inf

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        if self.how == "bound":
            return f"{self.label} {self.value:.4g}{unit} (the end of its range)"
        low = f"{'at most ' if self.open_low else ''}{self.low:.4g}"
        high = f"{'at least ' if self.open_high else ''}{self.high:.4g}"
        how = "" if self.how == "curvature" else f" by {self.how}"
        return f"{self.label} {self.value:.4g}{unit} ({low} to {high}{how})"


def as_numbers(estimate: Estimate) -> dict[str, Any]:
    """An estimate as plain numbers and texts, without its label."""
    return {
        "value": estimate.value, "low": estimate.low, "high": estimate.high,
        "unit": estimate.unit, "how": estimate.how, "open_low": estimate.open_low,
        "open_high": estimate.open_high,
    }  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """One model fitted to the lobes of a thread.

    model : its name; thread : with the fitted numbers; gain, lean : of the measurement
    chi2 : per degree of freedom, `freedom` of them; values : that were fitted
    estimates : label -> Estimate of what belongs to the thread and of nuisances
    products : what views tell of parameters that they do not tell apart
    notes : what a reader must know of this fit
    """

    model: str
    thread: Thread
    chi2: float
    freedom: int
    values: int
    estimates: dict[str, Estimate]
    products: tuple[Estimate, ...]
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """The fit in words, a line for each number."""
        said = [
            f"{self.model}: chi2/n {self.chi2:.3g} over {self.values} values, "
            f"{self.values - self.freedom} parameters"
        ]
        said += [f"  {estimate}" for estimate in self.estimates.values()]
        said += [f"  {product}" for product in self.products]
        return said + [f"  note: {note}" for note in self.notes]

    def as_json(self) -> dict[str, Any]:
        """The fit as plain numbers and texts."""
        return {
            "model": self.model,
            "chi2_per_freedom": self.chi2,
            "freedom": self.freedom,
            "values": self.values,
            "estimates": {name: as_numbers(each) for name, each in self.estimates.items()},
            "products": {each.label: as_numbers(each) for each in self.products},
            "notes": list(self.notes),
        }
