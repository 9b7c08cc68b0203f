"""What every test may ask for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# One fixed stream of examples: a failure on one machine is the same failure on every other.
settings.register_profile(
    "fabricusd",
    derandomize=True,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("fabricusd")

CHECKOUT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real inputs that are not part of the project; tests that need them skip without them."""
    folder = CHECKOUT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real inputs in {folder}")
    return folder


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A Dask cluster of two processes of this machine, of one thread each.

    It ends with its module: its threads read files, which other tests watch.
    """
    pytest.importorskip("distributed")
    from fabricusd.run.cluster import open_cluster

    with open_cluster("local:2") as found:
        yield found
