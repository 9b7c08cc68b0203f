"""Draw texels from a bake for a fit, and cluster them."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from fabricusd.appearance.weave.lookup import NO_THREAD
from fabricusd.bake.bake import FEWEST
from fabricusd.images.files import read_mip_level
from fabricusd.materials.bake_folder import BakedLay, MapSet
from fabricusd.materials.fit.target import TexelSample

DRAWN, KINDS = 2048, 12
"""Number of texels drawn from each lay, and of the clusters that represent them: the threads of a
repeat at several tangent angles."""

LEAST, MOST = 0.02, 8
"""Smallest share of the texels of a thread that is fitted individually, and most such threads."""

NEEDED = ("base_color", "roughness_along", "roughness_across", "normal", "tangent", "opacity")
OPTIONAL = ("transmission_color",)


def draw_texels(maps: MapSet, number: int, lay: BakedLay) -> TexelSample | None:
    """Draw and cluster texels of the lay `number`; None if the bake lacks maps that a fit needs."""
    if any(name not in maps.textures for name in NEEDED):
        return None
    tile = next(iter(maps.textures["base_color"]))
    optional = tuple(name for name in OPTIONAL if name in maps.textures)
    read = {name: read_mip_level(maps.textures[name][tile]) for name in (*NEEDED, *optional)}
    shape = read["base_color"].shape[:2]
    # Maps that shape reflections may be coarser, see `spanning`.
    read = {name: spread(pixels, shape) for name, pixels in read.items()}
    if "lay" in maps.textures:
        mine = read_mip_level(maps.textures["lay"][tile])[..., 0] == number
    else:
        mine = np.linalg.norm(read["normal"], axis=-1) > 0.5
    places = np.flatnonzero(mine.ravel())
    if not len(places):
        return None
    chosen = places[np.random.default_rng(1).integers(0, len(places), DRAWN)]
    value = {
        name: pixels.reshape(-1, pixels.shape[-1])[chosen].astype(np.float64)
        for name, pixels in read.items()
    }
    # Rotate to the weave's frame, with rows U and V, so that fits do not depend on the grain.
    turn = np.eye(3)
    u = lay.matrix[0] / np.linalg.norm(lay.matrix[0])
    turn[:2, :2] = [u, [-u[1], u[0]]]
    normal = value["normal"] @ turn.T
    smooth = value["tangent"] @ turn.T
    rough = np.stack((-smooth[:, 1], smooth[:, 0], smooth[:, 2]), axis=1)
    rows = np.concatenate(
        (
            value["base_color"], value["roughness_along"], value["roughness_across"],
            value["opacity"], normal, rough, *(value[name] for name in optional),
        ),
        axis=1,
    )  # fmt: skip
    numbers = np.full(len(chosen), NO_THREAD)
    if resolved(maps, lay):
        ids = read_mip_level(maps.textures["thread_id"][tile]).ravel()[chosen]
        numbers = _threads(ids, len(lay.fabric.threads) if lay.fabric else 0)
    shown = np.unique(numbers)
    most = max(KINDS // len(shown), 4)
    groups = [_kinds(rows[numbers == one], most) for one in shown]
    means = np.concatenate([group for group, _ in groups])
    share = np.array([np.mean(numbers == one) for one in shown])
    normal = means[:, 6:9] / np.maximum(np.linalg.norm(means[:, 6:9], axis=1, keepdims=True), 1e-9)
    return TexelSample(
        base=means[:, :3],
        smooth=means[:, 3],
        rough=means[:, 4],
        opacity=means[:, 5],
        normal=normal,
        tangent=means[:, 9:12],
        through=means[:, 12:] if optional else 0.0,
        weight=np.concatenate([w * s for (_, w), s in zip(groups, share, strict=True)]),
        thread=np.repeat(shown, [len(w) for _, w in groups]),
    )


def resolved(maps: MapSet, lay: BakedLay) -> bool:
    """Whether most texels belong to a single thread and the bake has the map `thread_id`."""
    if "thread_id" not in maps.textures or lay.fabric is None:
        return False
    width = read_mip_level(next(iter(maps.textures["thread_id"].values()))).shape[1]
    return bool(np.abs(lay.matrix).sum(axis=1).max() / width <= 1.0 / FEWEST)


def _threads(ids: NDArray[np.float32], types: int) -> NDArray[np.int64]:
    """Return thread numbers, with NO_THREAD for gaps and for threads that hardly show.

    All are NO_THREAD if only one thread shows.
    """
    # Earlier versions stored 255 for texels without a thread.
    numbers = np.where((ids >= 0) & (ids < 2 * types), ids, NO_THREAD).astype(np.int64)
    shown, counts = np.unique(numbers[numbers != NO_THREAD], return_counts=True)
    kept = shown[counts >= LEAST * len(ids)][:MOST]
    return np.where(np.isin(numbers, kept) & (len(kept) > 1), numbers, NO_THREAD)


def _kinds(
    rows: NDArray[np.float64], most: int = KINDS
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cluster (n, c) texels into at most `most` groups; return the groups' means and shares."""
    different, counts = np.unique(np.round(rows, 2), axis=0, return_counts=True)
    if len(different) <= most:
        # If a texel spans whole repeats, all texels are alike and one represents them.
        return different, counts / counts.sum()
    with warnings.catch_warnings():
        # A cluster may stay empty; it is dropped below.
        warnings.simplefilter("ignore", UserWarning)
        means, kind = kmeans2(rows, most, minit="++", seed=1)
    counts = np.bincount(kind, minlength=most)
    return means[counts > 0], counts[counts > 0] / counts.sum()


def mean_texel(maps: MapSet, number: int) -> dict[str, tuple[float, ...]]:
    """Return the mean of each available map over the texels of a lay; directions are normalised."""
    from fabricusd.materials.networks.surfaces import MAPS

    tile = next(iter(next(iter(maps.textures.values()))), 0) if maps.textures else 0
    mine = None
    if "lay" in maps.textures:
        mine = read_mip_level(maps.textures["lay"][tile])[..., 0] == number
    found = {}
    for name, kind in MAPS.items():
        if tile not in maps.textures.get(name, {}):
            continue
        pixels = read_mip_level(maps.textures[name][tile])
        if mine is not None and mine.any():
            pixels = spread(pixels, mine.shape)[mine][None]
        mean = pixels.mean(axis=(0, 1), dtype=np.float64)
        if kind == "vector3":
            mean /= max(float(np.linalg.norm(mean)), 1e-9)
        found[name] = tuple(map(float, mean))
    return found


def spread(pixels: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.float32]:
    """(h, w, c) pixels at the size of a finer map, each repeated."""
    if pixels.shape[:2] == shape:
        return pixels
    rows = np.arange(shape[0]) * pixels.shape[0] // shape[0]
    columns = np.arange(shape[1]) * pixels.shape[1] // shape[1]
    return np.asarray(pixels[rows[:, None], columns])
