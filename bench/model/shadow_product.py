"""Whether masking times shadowing is nearer to the geometry of the cloth than either factor alone.

    python bench/model/shadow_product.py

The geometry is the height field with round threads and single scattering. A place on a thread is
weighted by the area that it shows to the viewer, `max(n.wo, 0)/n.N`, or by 0 if the march finds it
hidden. It sends `f_s cos theta_i` if the march finds it lit (`f_s` accounts for the dark side of a
thread). At the same places the model sends `f_s P cos theta_i / Q` times M, times g, or times both;
g is marched over round threads (level `thread`) or flat ones (level `weave`). `<g>` is its mean
over all threads, or over those of the same set, each place weighted by the light that its slope
would catch.
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from fabricusd.appearance import plain
from fabricusd.appearance.scattering.plain_lobes import angles
from fabricusd.appearance.shadow.methods import compile_shadow, shadowing
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.chart.panels.shadows import WOVEN
from fabricusd.fabric import Fabric, even
from fabricusd.schema import load

VARIANTS = (
    "neither", "M", "g", "M g", "M g / <g>", "M g / <g> of its set", "g, flat", "M g, flat",
)  # fmt: skip

Array = np.ndarray


def directions(rng: np.random.Generator, count: int) -> Array:
    """(count, 3) cosine-distributed directions, at most 80 degrees from the normal."""
    z = np.sqrt(rng.uniform(math.cos(math.radians(80)) ** 2, 1, count))
    azimuth = rng.uniform(0, 2 * math.pi, count)
    flat = np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), z], axis=1)


def compare(fabric: Fabric, pairs: int, count: int) -> Array:
    """(pairs, 1 + variants) brightness: first of the geometry, then of the model's variants."""
    rng = np.random.default_rng(1)
    cloth = compile_fabric(fabric, precision=np.float64)
    traced, ribbons = (
        compile_shadow(fabric, "traced", level=level, precision=np.float64)
        for level in ("thread", "weave")
    )
    k = np.arange(count)[:, None]
    uv = (k * np.array([0.7548776662466927, 0.5698402909980532])) % 1.0 * fabric.weave.cells.shape
    hit = lookup(cloth, uv)
    on = ~hit.gap
    # One row of the result for each pair of directions.
    rows = []
    for wi, wo in zip(directions(rng, pairs), directions(rng, pairs), strict=True):
        lit, seen = (
            shadowing(fabric, np.tile(w, (count, 1)), uv, compiled=(cloth, traced))
            for w in (wi, wo)
        )
        flat = shadowing(fabric, np.tile(wi, (count, 1)), uv, compiled=(cloth, ribbons))
        f, m, p, shown, caught = (np.zeros(count) for _ in range(5))
        for share in plain.shares(fabric):
            kind = [t is share.thread for t in fabric.thread_list].index(True)
            here = on & (hit.set == int(share.is_warp)) & (hit.thread == kind)
            if not here.any():
                continue
            psi0 = hit.angle[here]
            i, o = (
                plain.to_thread(np.tile(w, (len(psi0), 1)), share.is_warp, psi0) for w in (wi, wo)
            )
            a, b = angles(i), angles(o)
            value = plain.thread_value(share.thread, share.model, i, o).mean(axis=-1)
            f[here] = value * np.cos(a.theta)
            m[here] = plain.masked(a.phi, b.phi, fabric.masking_width)
            p[here] = plain.masked(a.psi, b.psi, fabric.masking_width)
            caught[here] = np.maximum(i[:, 2], 0)
            # Cosines of the tube's normal, sqrt(1 - w^2) n_t + w b, with the viewer and with N.
            w = np.clip(hit.across[here], -0.999, 0.999)
            up = np.sqrt(1 - w * w) * np.cos(hit.angle[here])
            facing = np.sqrt(1 - w * w) * o[:, 2] + w * o[:, 1]
            shown[here] = np.maximum(facing, 0) / up
        visible = np.where(on, shown * seen, wo[2])
        geometry = float((visible * lit * f).sum() / visible.sum())
        q = float(plain.normalization(fabric, wi[None], wo[None])[0])
        base = f * p / q
        even = lit * caught.sum() / max(float((lit * caught).sum()), 1e-3)
        own = np.zeros(count)
        for which in (0, 1):
            mine = on & (hit.set == which)
            let = max(float((lit * caught)[mine].sum()), 1e-3)
            own[mine] = (lit * caught[mine].sum() / let)[mine]
        rows.append(
            [
                geometry,
                *(
                    float((base * x).mean())
                    for x in (1.0, m, lit, m * lit, m * even, m * own, flat, m * flat)
                ),
            ]
        )
    return np.array(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=300)
    parser.add_argument("--places", type=int, default=3000)
    options = parser.parse_args()
    print("Mean absolute difference from the geometry, over the geometry's mean; in brackets the")
    print("model's mean over the geometry's. Best in each row in bold. Last, for the fourth to the")
    print("sixth: mean absolute difference of level `weave` from `far`, over far's mean.\n")
    print("| preset | " + " | ".join(VARIANTS) + " | off far |")
    print("|---|" + "---|" * (1 + len(VARIANTS)))
    for name in WOVEN:
        found = compare(even(load(name)), options.pairs, options.places)
        true = found[:, 0]
        errors = np.abs(found[:, 1:] - true[:, None]).mean(axis=0) / true.mean()
        means = found[:, 1:].mean(axis=0) / true.mean()
        cells = [f"{e:.2f} ({x:.2f})" for e, x in zip(errors, means, strict=True)]
        best = int(errors.argmin())
        cells[best] = f"**{cells[best]}**"
        far = found[:, 2]
        off = np.abs(found[:, 4:7] - far[:, None]).mean(axis=0) / far.mean()
        cells.append(", ".join(f"{x:.2f}" for x in off))
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
