"""Keep fits in the cache, by everything that they depend on: a look made again needs no fit."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.cloth_key import cloth_key
from fabricusd.cache import kept
from fabricusd.fabric import Fabric
from fabricusd.kernels.cache import fingerprint
from fabricusd.materials.fit.fit import Fitted, fit, fit_threads, thread_factors, with_threads
from fabricusd.materials.fit.target import TexelSample
from fabricusd.materials.fit.thread_maps import Factors
from fabricusd.materials.networks.look import Look

Waiting = Callable[[], None]
"""Is called before a fit that is not in the cache."""


def fit_lay(
    texels: TexelSample, fabric: Fabric, kinds: Sequence[str], *, waiting: Callable[[str], Waiting]
) -> tuple[dict[str, Fitted], dict[int, Fitted], Factors]:
    """Return the fit of each kind of surface to a lay, and those of single threads with their
    factors, if texels resolve threads.

    waiting : for "threads" or a kind, what to call before that fit if it is not in the cache
    """
    factors: Factors = {}
    threads: dict[int, Fitted] = {}
    own = texels
    if texels.threads:
        threads = kept_fit_threads(texels, fabric, waiting=waiting("threads"))
        looks = {one: fitted.look for one, fitted in threads.items()}
        own, factors = with_threads(texels, looks), thread_factors(looks, texels.shares)
    found = {}
    for kind in kinds:
        takes = texels if kind == "preview" else own
        found[kind] = kept_fit(kind, takes, fabric, baked=texels, waiting=waiting(kind))
    return found, threads, factors


def kept_fit(
    kind: str, texels: TexelSample, fabric: Fabric, *, baked: TexelSample, waiting: Waiting
) -> Fitted:
    """Return `fit.fit` of these arguments."""

    def made() -> Mapping[int, Fitted]:
        return {0: fit(kind, texels, fabric, baked=baked)}

    return _kept((kind, *_key(texels), *_key(baked), *cloth_key(fabric)), made, waiting)[0]


def kept_fit_threads(texels: TexelSample, fabric: Fabric, *, waiting: Waiting) -> dict[int, Fitted]:
    """Return `fit.fit_threads` of these arguments."""
    key = ("threads", *_key(texels), *cloth_key(fabric))
    return _kept(key, lambda: fit_threads(texels, fabric), waiting)


def _kept(
    key: tuple[object, ...], make: Callable[[], Mapping[int, Fitted]], waiting: Waiting
) -> dict[int, Fitted]:
    def made() -> NDArray[np.uint8]:
        waiting()
        said = {str(number): one.as_dict() for number, one in make().items()}
        return np.frombuffer(json.dumps(said).encode(), np.uint8)

    held = json.loads(kept("fits", (fingerprint(), sources(), *key), made).tobytes())
    return {int(number): _fitted(one) for number, one in held.items()}


def _fitted(said: dict[str, Any]) -> Fitted:
    look: dict[str, Any] = {
        k: tuple(v) if isinstance(v, list) else v for k, v in said.pop("parameters").items()
    }
    return Fitted(look=Look(**look), **said)


def _key(texels: TexelSample) -> tuple[object, ...]:
    # Sums of arrays differ in their last digit with the place of the arrays in memory.
    return tuple(np.round(np.atleast_1d(getattr(texels, one.name)), 7) for one in fields(texels))


@lru_cache(maxsize=1)
def sources() -> str:
    """Digest of the sources of this folder, on which a fit depends."""
    digest = hashlib.blake2b(digest_size=10)
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
