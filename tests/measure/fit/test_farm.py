"""A fit on a cluster is that of this process."""

from __future__ import annotations

from fabricusd.measure import fit_thread
from tests.measure.shoots import SPUN, lobes_of


def test_a_thread_is_the_same_to_the_bit(cluster):
    lobes = lobes_of(SPUN, "coarse")
    here = fit_thread(lobes, "microcylinder")
    there = fit_thread(lobes, "microcylinder", scheduler=cluster)
    assert there.as_json() == here.as_json()
