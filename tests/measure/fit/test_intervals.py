"""95 % intervals hold the truth in about 95 of 100 noisy repeats."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fabricusd.measure import fit_thread
from fabricusd.measure.fit.intervals import RISE, SIGMAS
from fabricusd.measure.fit.parameters import volume_level
from tests.measure.shoots import FILAMENT, SPUN, WIDE, lobes_of


def test_the_level_is_that_of_two_sided_95_percent():
    assert SIGMAS == pytest.approx(1.95996, abs=1e-5)
    assert RISE == pytest.approx(SIGMAS**2)


def held(thread, repeats: int) -> dict[str, list[bool]]:
    """Label -> whether each repeat's interval holds the truth."""
    true = {
        "eta": thread.ior, "gs": math.degrees(thread.gamma_surface),
        "gv": math.degrees(thread.gamma_volume), "kd": thread.isotropic,
        **dict(zip(("A red", "A green", "A blue"), thread.albedo, strict=True)),
    }  # fmt: skip
    level = volume_level("microcylinder", thread.gamma_volume, thread.isotropic)
    found: dict[str, list[bool]] = {}
    for seed in range(repeats):
        fit = fit_thread(lobes_of(thread, seed=seed), "microcylinder", workers=1)
        for label, value in true.items():
            each = fit.estimates[label]
            found.setdefault(label, []).append(bool(each.low <= value <= each.high))
        for product, albedo in zip(fit.products, thread.albedo, strict=False):
            inside = bool(product.low <= albedo * level <= product.high)
            found.setdefault("product", []).append(inside)
    return found


def test_a_few_repeats_hold_the_truth_mostly_and_not_always():
    """Of 56 intervals about 53 hold the truth, by chance from 49 on."""
    every = np.concatenate(list(held(SPUN, 8).values()))
    assert 0.87 <= every.mean() < 1


@pytest.mark.exhaustive
@pytest.mark.parametrize("thread", [SPUN, FILAMENT, WIDE], ids=["spun", "filament", "wide"])
def test_200_repeats_hold_the_truth_in_90_to_99_percent(thread):
    for label, inside in held(thread, 200).items():
        assert 0.90 <= np.mean(inside) <= 0.995, label
