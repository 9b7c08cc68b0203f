"""Keep fits near by in the cache, by the fabric and the mixture that they depend on."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.cloth_key import cloth_key
from fabricusd.cache import kept
from fabricusd.fabric import Fabric
from fabricusd.kernels.cache import fingerprint
from fabricusd.materials.lobes.mixture import Mixture
from fabricusd.materials.near.fit import fit_near
from fabricusd.materials.near.mixture import NearMixture
from fabricusd.materials.near.parts import Parts

Progress = Callable[[str], None]

_ARRAYS = ("factors", "own", "through", "tinted")


def near_of(fabric: Fabric, far: Mixture, progress: Progress | None = None) -> NearMixture:
    """Return `fit.fit_near` of these arguments; `progress` gets a line if it is to be fitted."""

    def made() -> NDArray[np.uint8]:
        if progress:
            progress(f"fitting lobes to the threads of {fabric.name}")
        near = fit_near(fabric, far)
        stream = io.BytesIO()
        arrays = {name: getattr(near, name) for name in _ARRAYS}
        np.savez(stream, **arrays, **asdict(near.parts))
        return np.frombuffer(stream.getvalue(), np.uint8)

    key = (fingerprint(), _sources(), repr(asdict(far)), *cloth_key(fabric))
    held = np.load(io.BytesIO(kept("near", key, made).tobytes()))
    parts = Parts(share=held["share"], angle=held["angle"], spread=held["spread"])
    return NearMixture(far=far, parts=parts, **{name: held[name] for name in _ARRAYS})


def moved_to(near: NearMixture, parts: Parts) -> NearMixture:
    """Return the same lobes on a cloth of slightly other parts, those of a bake's own texels.

    The means of the factors stay 1. A lobe none of whose threads are there is spread over all.
    """
    means = np.einsum("kbc,b->kc", near.factors, parts.share)[:, None]
    even = 1.0 / max(float(parts.share.sum()), 1e-9)
    factors = np.where(means > 1e-6, near.factors / np.maximum(means, 1e-6), even)
    return replace(near, parts=parts, factors=factors)


@lru_cache(maxsize=1)
def _sources() -> str:
    """Digest of this folder's sources, on which a fit depends."""
    digest = hashlib.blake2b(digest_size=10)
    for name in ("parts", "points", "mixture", "fit"):
        digest.update(Path(__file__).with_name(f"{name}.py").read_bytes())
    return digest.hexdigest()
