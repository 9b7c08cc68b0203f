"""The lobes of the texel under a point as MaterialX nodes, for the network of `lobes.network`.

The four shares of a set are one vector, so each sum over parts is a dot product. With w the shares
of the set that runs along a lobe's axis and m its membership, mu = m.w psi / m.w + lean/w, and
V = m.w psi^2 / m.w - (m.w psi / m.w)^2 + spread/w - (lean/w)^2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.texels.moment_indices import PARTS
from fabricusd.materials.lobes.network import Texel
from fabricusd.materials.near.inputs import Laid
from fabricusd.materials.near.maps import LEAN, SHARES, TINTS
from fabricusd.materials.near.mixture import EPSILON, STEEPEST, THIN, NearMixture, constants
from fabricusd.materials.networks.graph import Builder, Link, Source, Value
from fabricusd.materials.networks.surfaces import one

Floats = NDArray[np.float64]

NOUNS = ("weft", "warp")


class NearTexel(Texel):
    """Nodes of what the texel shows: see `lobes.network.Texel`."""

    def __init__(self, b: Builder, near: NearMixture, laid: Laid) -> None:
        self.b, self.near = b, near
        at = _place(b, laid)
        read = {
            name: b.add(
                name, "image", kind, f"ND_image_{kind}", file=source, texcoord=at,
                **_modes(laid),
            )
            for name, source in laid.textures.items()
            for kind in ("color3" if name in TINTS else "vector4",)
        }  # fmt: skip
        self.shares = [read[name] for name in SHARES]
        ones = Value("vector4", (1.0,) * PARTS)
        self.sets = [_dot(b, f"{noun}_share", w, ones) for noun, w in self._named(self.shares)]
        self.cover = b.math("threads_cover", "add", "float", *self.sets)
        self.thin = [
            b.math(f"{noun}_size", "max", "float", w, one(THIN))
            for noun, w in self._named(self.sets)
        ]
        numbers = [_extracted(b, f"lean_{k}", read[LEAN], k) for k in range(4)]
        self.lean, self.within = [], []
        for k, noun in enumerate(NOUNS):
            lean = b.math(f"{noun}_lean", "divide", "float", numbers[2 * k], self.thin[k])
            spread = b.math(f"{noun}_spread", "divide", "float", numbers[2 * k + 1], self.thin[k])
            flat = b.math(f"{noun}_lean_2", "multiply", "float", lean, lean)
            left = b.math(f"{noun}_within_free", "subtract", "float", spread, flat)
            self.lean.append(lean)
            self.within.append(b.math(f"{noun}_within", "max", "float", left, one(0.0)))
        self.tints = [self._tint(k, read.get(TINTS[k])) for k in (0, 1)]

    def color(self, name: str, row: int, rgb: Sequence[float]) -> Source:
        """Return the colour of a lobe, of the diffuse part (row -2) or of the sheen (row -1)."""
        return self._sum(name, self.near.factors[row] * np.array(rgb))

    def through(self) -> Source | None:
        """Return the share of the light from behind that comes through; None without any."""
        return self._sum("through", self.near.through) if self.near.through.any() else None

    def placed(self, name: str, number: int) -> tuple[Source, Source]:
        """Return the tilt and the widths of a lobe."""
        b, (lobe, tilt), known = self.b, self.near.lobes[number], constants(self.near, number)
        across = one(lobe.alpha_across)
        if not known.own.any():
            return one(tilt), Value("vector2", (lobe.alpha_along, lobe.alpha_across))
        along, angle = lobe.along, self.near.parts.angle
        mine = known.own.reshape(2, PARTS)[along]
        psi = angle.reshape(2, PARTS)[along]
        every = self._dots(f"{name}_every", known.membership)
        own = _dot(b, f"{name}_own", self.shares[along], _four(mine))
        share = b.math(f"{name}_share", "divide", "float", own, _floor(b, f"{name}_some", every))
        own = _floor(b, f"{name}_any", own)
        first, second = (
            b.math(
                f"{name}_mean_{k}", "divide", "float",
                _dot(b, f"{name}_moment_{k}", self.shares[along], _four(mine * psi**k)), own,
            )
            for k in (1, 2)
        )  # fmt: skip
        between = b.math(
            f"{name}_between", "subtract", "float", second,
            b.math(f"{name}_mean_square", "multiply", "float", first, first),
        )  # fmt: skip
        apart = b.math(f"{name}_variance_free", "add", "float", between, self.within[along])
        apart = b.math(f"{name}_variance", "max", "float", apart, one(0.0))
        ratio = b.math(
            f"{name}_ratio", "multiply", "float",
            b.math(f"{name}_not_0", "add", "float", apart, one(EPSILON)),
            one(1.0 / (known.variance + EPSILON)),
        )  # fmt: skip
        root = b.add(f"{name}_root", "sqrt", "float", "ND_sqrt_float", **{"in": ratio})
        off = b.math(f"{name}_off", "multiply", "float", root, one(tilt - known.mean))
        mean = b.math(f"{name}_mean", "add", "float", first, self.lean[along])
        turned = b.math(f"{name}_turned", "add", "float", mean, off)
        angle_here = _mixed(b, f"{name}_tilt", one(tilt), turned, share)
        wide, narrow = lobe.alpha_along**2, self.near.own[number] ** 2
        less = b.math(f"{name}_wider", "multiply", "float", ratio, one(wide - narrow))
        here = b.math(f"{name}_square", "add", "float", less, one(narrow))
        square = _mixed(b, f"{name}_widths", one(wide), here, share)
        square = _clamped(b, f"{name}_bounded", square, min(narrow, wide), 1.0)
        alpha = b.add(f"{name}_alpha", "sqrt", "float", "ND_sqrt_float", **{"in": square})
        both = b.add(
            f"{name}_roughness", "combine2", "vector2", "ND_combine2_vector2", in1=alpha, in2=across
        )
        return _clamped(b, f"{name}_steep", angle_here, -STEEPEST, STEEPEST), both

    def _named(self, pair: Sequence[Link]) -> list[tuple[str, Link]]:
        return list(zip(NOUNS, pair, strict=True))

    def _dots(self, name: str, numbers: Floats) -> Link:
        """Return the sum over all parts of the shares times `numbers` (8,)."""
        two = [
            _dot(self.b, f"{name}_{noun}", w, _four(half))
            for (noun, w), half in zip(
                self._named(self.shares), numbers.reshape(2, PARTS), strict=True
            )
        ]
        return self.b.math(name, "add", "float", *two)

    def _sum(self, name: str, rows: Floats) -> Source:
        """Return the sum of rows (8, 3) over the parts, times the tints."""
        b, parts = self.b, []
        for k, (noun, w) in enumerate(self._named(self.shares)):
            half = rows.reshape(2, PARTS, 3)[k]
            channels = {
                f"in{c + 1}": _dot(b, f"{name}_{noun}_{'rgb'[c]}", w, _four(half[:, c]))
                for c in range(3)
            }
            made = b.add(f"{name}_{noun}", "combine3", "color3", "ND_combine3_color3", **channels)
            tint = self.tints[k]
            if tint is not None:
                made = b.math(f"{name}_{noun}_tinted", "multiply", "color3", made, tint)
            parts.append(made)
        return b.math(f"{name}_parts", "add", "color3", *parts)

    def _tint(self, k: int, read: Link | None) -> Link | None:
        if read is None:
            return None
        part, b, noun = float(self.near.tinted[k]), self.b, NOUNS[k]
        ratio = b.math(f"{noun}_tint", "divide", "color3", read, self.thin[k], short=True)
        less = b.math(f"{noun}_tint_part", "multiply", "color3", ratio, one(part))
        return b.math(f"{noun}_tint_all", "add", "color3", less, Value("color3", (1.0 - part,) * 3))


def _place(b: Builder, laid: Laid) -> Link:
    """Return where to read the textures."""
    st = b.add("st", "texcoord", "vector2", "ND_texcoord_vector2")
    if laid.threads is None:
        return st
    found = []
    for k, (u, v, offset) in enumerate(laid.threads):
        size = laid.repeat[k]
        scaled = _dot2(b, f"repeats_{'uv'[k]}_sum", st, (float(u / size), float(v / size)))
        found.append(
            b.math(f"repeats_{'uv'[k]}", "add", "float", scaled, one(float(offset / size)))
        )
    return b.add(
        "repeats", "combine2", "vector2", "ND_combine2_vector2", in1=found[0], in2=found[1]
    )


def _modes(laid: Laid) -> dict[str, Source]:
    mode = Value("string", "clamp" if laid.threads is None else "periodic")
    return {"uaddressmode": mode, "vaddressmode": mode}


def _four(numbers: Floats) -> Value:
    return Value("vector4", tuple(float(x) for x in numbers))


def _dot(b: Builder, name: str, vector: Source, numbers: Source) -> Link:
    return b.add(name, "dotproduct", "float", "ND_dotproduct_vector4", in1=vector, in2=numbers)


def _dot2(b: Builder, name: str, vector: Source, numbers: tuple[float, float]) -> Link:
    given = Value("vector2", numbers)
    return b.add(name, "dotproduct", "float", "ND_dotproduct_vector2", in1=vector, in2=given)


def _extracted(b: Builder, name: str, vector: Source, index: int) -> Link:
    inputs: dict[str, Source] = {"in": vector, "index": Value("integer", index)}
    return b.add(name, "extract", "float", "ND_extract_vector4", **inputs)


def _floor(b: Builder, name: str, number: Source) -> Link:
    # MaterialX writes constants into shaders with six decimals: a smaller one would be 0.
    return b.math(name, "max", "float", number, one(1e-6))


def _mixed(b: Builder, name: str, none: Source, whole: Source, share: Source) -> Link:
    """Return `none` where the share is 0, and `whole` where it is 1."""
    return b.add(name, "mix", "float", "ND_mix_float", fg=whole, bg=none, mix=share)


def _clamped(b: Builder, name: str, number: Source, low: float, high: float) -> Link:
    inputs: dict[str, Source] = {"in": number, "low": one(low), "high": one(high)}
    return b.add(name, "clamp", "float", "ND_clamp_float", **inputs)
