"""Woven cloth as a BSDF of Mitsuba 3: the thread law from afar, from a file of fabricusd.

    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")     # or cuda_ad_rgb
    import fabricusd_cloth            # registers the plugin

    cloth = mi.load_dict({"type": "fabricusd_cloth", "filename": "linen_plain.json"})

`fabricusd material DIR --mitsuba FOLDER` writes the JSON file and this file. The weft runs along
the tangent of the surface, dp/du, turned by `rotation` [degrees]. Both sides look alike. Gaps let
light straight through. Light is sampled by cosine. In each function below, wi points towards the
light and wo towards the viewer, in the frame (weft, warp, normal); Mitsuba's own names are the
other way around.
"""

from __future__ import annotations

import json
from typing import Any

import drjit as dr
import mitsuba as mi

VERSION = 3
"""Of the JSON file."""

LEAST_COSINE = 0.08715574274765817
"""cos 85 degrees: least cosine that steep thread counts with under `projected`."""

COS2_D_MINIMUM, COS_SUM_MINIMUM, NOTHING = 1e-6, 1e-3, 1e-12
LEAST_WIDTH_2 = 1e-12
LEAST_SEEN = 0.01
"""Least share of its places that thread counts with under `visible`."""

PROJECTED = ("projected", "visible")
"""Laws that weigh threads by the area that is seen."""


TABLES = ("means", "excess", "shares", "gaps")


class Cloth:
    """The tables of one fabric, and its law; arrays are on the device."""

    def __init__(self, said: dict[str, Any]) -> None:
        if said.get("fabricusd_cloth") != VERSION:
            raise ValueError(f"is no fabric of version {VERSION}; write it with --mitsuba")
        self.said = said
        self.law, self.nodes, self.threads = said["law"], said["nodes"], said["threads"]
        self.tables = {name: mi.Float(said[name]) for name in TABLES if name in said}
        self.columns = int(said.get("columns", 0))

    def value(self, wi: Any, wo: Any) -> Any:
        """Return f cos; 0 unless both directions are above the cloth."""
        seen, total = mi.Float(0), mi.Color3f(0)
        for warp in (False, True):
            i, o = (self._along(warp, w) for w in (wi, wo))
            shared = self._shared(warp, i, o)
            share = self._share(warp, wo)
            for k, node in enumerate(self.nodes):
                if node["warp"] != warp:
                    continue
                c, s, thread = node["cosine"], node["sine"], self.threads[node["thread"]]
                p = node["weight"] * self._weight(c, s, i, o, shared)
                if share:
                    first, second, third, fourth = share
                    part = first + s * (second + s * (third + s * s * fourth))
                    p = p * dr.maximum(part, LEAST_SEEN)
                seen += p
                surface, volume = self._segment(thread, c, s, i, o)
                p *= self._lit(k, wi)
                total += p * (surface + volume * mi.Color3f(thread["albedo"]))
        q = self._total(seen, wo)
        above = (wi.z > 0) & (wo.z > 0) & (q > NOTHING)
        return dr.select(above, dr.maximum(total, 0) / dr.maximum(q, NOTHING), 0)

    def openness(self, wo: Any) -> Any:
        """Return the share of a view that passes between the threads."""
        if self.said["opaque"]:
            return mi.Float(0)
        return self._gap(wo)

    def _gap(self, wo: Any) -> Any:
        if self.law not in PROJECTED:
            return mi.Float(self.said["gap"])
        if self.law == "visible":
            return self._by_view("gaps", wo)
        wide, tall, up_2 = self.said["wide_2"], self.said["tall_2"], dr.maximum(wo.z**2, 1e-12)
        weft = wide[0] + tall[0] * wo.y**2 / up_2
        warp = wide[1] + tall[1] * wo.x**2 / up_2
        return dr.maximum(0, 1 - dr.sqrt(weft)) * dr.maximum(0, 1 - dr.sqrt(warp))

    @staticmethod
    def _along(warp: bool, w: Any) -> tuple[Any, Any, Any, Any]:
        """(along the set's threads, across, up, 1/length without across)."""
        along, across = (w.y, -w.x) if warp else (w.x, w.y)
        return along, across, w.z, dr.rsqrt(dr.maximum(along**2 + w.z**2, 1e-30))

    def _overlap(self, sine: Any, cosine: Any) -> Any:
        """Return u of `masked`, 1 where two angles are alike; given are sums of their (co)sines."""
        if self.law != "masked":
            return mi.Float(0)
        half = dr.acos(dr.minimum(0.5 * dr.sqrt(sine**2 + cosine**2), 1))
        return dr.exp(-self.said["precision"] * half**2)

    def _shared(self, warp: bool, i: Any, o: Any) -> Any:
        """Return what the law's weights need and all threads of a set have in common."""
        if self.law in PROJECTED:
            wide, tall = self.said["wide_2"][int(warp)], self.said["tall_2"][int(warp)]
            return tall / max(wide, LEAST_WIDTH_2) * o[1] ** 2
        return self._overlap(i[0] * i[3] + o[0] * o[3], i[2] * i[3] + o[2] * o[3])

    def _weight(self, c: float, s: float, i: Any, o: Any, shared: Any) -> Any:
        """Return how much of the view thread at this tangent angle takes."""
        if self.law == "unmasked":
            return mi.Float(1)
        facing = s * o[0] + c * o[2]
        if self.law in PROJECTED:
            seen = dr.maximum(facing + dr.sqrt(facing**2 + shared), 0)
            return 0.5 * seen / max(c, LEAST_COSINE)
        lit, seen = dr.maximum(s * i[0] + c * i[2], 0), dr.maximum(facing, 0)
        return _masked(lit * i[3], seen * o[3], shared)

    def _segment(self, thread: dict[str, Any], c: float, s: float, i: Any, o: Any) -> Any:
        """(surface, volume without albedo) of one tangent angle, mask and cosine included."""
        t_i, n_i = c * i[0] - s * i[2], s * i[0] + c * i[2]
        t_o, n_o = c * o[0] - s * o[2], s * o[0] + c * o[2]
        cos_i, cos_o = dr.sqrt(i[1] ** 2 + n_i**2), dr.sqrt(o[1] ** 2 + n_o**2)
        inv_i, inv_o = 1 / dr.maximum(cos_i, 1e-30), 1 / dr.maximum(cos_o, 1e-30)
        sine, cosine = i[1] * inv_i + o[1] * inv_o, n_i * inv_i + n_o * inv_o
        cos_half = 0.5 * dr.sqrt(sine**2 + cosine**2)
        mask = cos_i
        if self.law == "masked":
            lit, seen = dr.maximum(n_i * inv_i, 0), dr.maximum(n_o * inv_o, 0)
            mask = cos_i * _masked(lit, seen, self._overlap(sine, cosine))
        sum_s, sum_c = t_i + t_o, cos_i + cos_o
        cos2_d = 0.25 * (sum_s**2 + sum_c**2)
        theta_h = dr.atan2(sum_s, sum_c)
        reflected, once = _fresnel(thread["ior_excess"], dr.sqrt(cos2_d) * cos_half)
        on_surface, on_volume = (
            thread[name][1] * dr.exp(-thread[name][0] * theta_h**2)
            for name in ("surface", "volume")
        )
        compressed = mask / dr.maximum(cos2_d, COS2_D_MINIMUM)
        kd = thread["isotropic"]
        volume = once**2 * ((1 - kd) * on_volume + kd) / dr.maximum(sum_c, COS_SUM_MINIMUM)
        return reflected * cos_half * on_surface * compressed, volume * compressed

    def _lit(self, node: int, wi: Any) -> Any:
        """Return the share of the light that neighbouring threads let through to a node."""
        if not self.columns:
            return mi.Float(1)
        nodes, rows = len(self.nodes), int(self.said["elevations"])
        turn = _diamond(wi.x, wi.y) * (0.25 * self.columns)
        across = dr.sqrt(dr.clip(wi.z, 0, 1)) * (rows - 1)
        column = dr.clip(mi.Int32(turn), 0, self.columns - 1)
        row = dr.clip(mi.Int32(across), 0, rows - 2)
        here = mi.UInt32(column * rows + row) * nodes + node

        def at(index: Any) -> Any:
            low = dr.gather(mi.Float, self.tables["means"], index)
            high = dr.gather(mi.Float, self.tables["means"], index + rows * nodes)
            return dr.lerp(low, high, turn - mi.Float(column))

        return dr.lerp(at(here), at(here + nodes), across - mi.Float(row))

    def _share(self, warp: bool, wo: Any) -> list[Any]:
        """Return coefficients of 1, s, s^2 and s^4 of what is seen of a set's places, under
        `visible`."""
        if self.law != "visible" or dr.width(self.tables["shares"]) == 1:
            return []
        rows, columns = self.said["share_shape"]
        turn = _diamond(wo.x, wo.y) * (0.25 * columns)
        across = dr.sqrt(dr.clip(wo.z, 0, 1)) * (rows - 1)
        column = dr.clip(mi.Int32(turn), 0, columns - 1)
        row = dr.clip(mi.Int32(across), 0, rows - 2)
        here = mi.UInt32(column * rows + row) * 8 + 4 * int(warp)

        def at(index: Any) -> Any:
            low = dr.gather(mi.Float, self.tables["shares"], index)
            high = dr.gather(mi.Float, self.tables["shares"], index + 8 * rows)
            return dr.lerp(low, high, turn - mi.Float(column))

        return [dr.lerp(at(here + k), at(here + k + 8), across - mi.Float(row)) for k in range(4)]

    def _total(self, seen: Any, wo: Any) -> Any:
        if self.law == "masked":
            return seen + self.said["gap"] * wo.z
        # How much brighter than a white sky the cloth would be in a view, at least 1; under
        # `visible`, over what does not pass the gaps.
        most = self._by_view("excess", wo)
        if self.law == "unmasked":
            return most
        return seen * most if self.law == "visible" else seen * most / (1 - self._gap(wo))

    def _by_view(self, name: str, wo: Any) -> Any:
        """Return what a table by view holds; a single entry stands for 1."""
        table = self.tables[name]
        if dr.width(table) == 1:
            return mi.Float(1)
        rows, columns = self.said["excess_shape"]
        across = (1 - dr.sqrt(dr.clip(wo.z, 0, 1))) * (rows - 1)
        turn = _diamond(wo.x, wo.y) * (0.25 * columns)
        row = dr.clip(mi.Int32(across), 0, rows - 2)
        column = dr.clip(mi.Int32(turn), 0, columns - 1)
        a, b = across - mi.Float(row), turn - mi.Float(column)
        near = mi.UInt32(row * (columns + 1) + column)

        def at(index: Any) -> Any:
            return dr.gather(mi.Float, table, index)

        low = dr.lerp(at(near), at(near + 1), b)
        far = near + (columns + 1)
        return dr.lerp(low, dr.lerp(at(far), at(far + 1), b), a)


def _masked(x: Any, y: Any, u: Any) -> Any:
    return x * y + u * (dr.minimum(x, y) - x * y)


def _diamond(x: Any, y: Any) -> Any:
    """In 0 to 4: 1 per quadrant, linear in y/(|x| + |y|) inside it."""
    part = x / dr.maximum(dr.abs(x) + dr.abs(y), 1e-30)
    return dr.select(y >= 0, 1 - part, 3 + part)


def _fresnel(excess: float, c: Any) -> tuple[Any, Any]:
    """(reflected, transmitted) at the cosine c; excess : eta^2 - 1."""
    c = dr.maximum(c, 1e-12)
    g = dr.sqrt(excess + c * c)
    p = c + excess * c
    inverse, inverse_p = 1 / ((c + g) * (c + g)), 1 / ((p + g) * (p + g))
    r_s = excess * inverse
    reflected = 0.5 * (r_s * r_s + (p - g) * (p - g) * inverse_p)
    return reflected, 2 * g * (c * inverse + p * inverse_p)


def register() -> None:
    """Register the plugin `fabricusd_cloth` in the variant that is set."""
    variant = mi.variant()
    if not variant or "rgb" not in variant or "scalar" in variant or "polarized" in variant:
        raise ImportError(
            f"fabricusd_cloth: Mitsuba's variant is {variant}; call mi.set_variant with "
            "llvm_ad_rgb or cuda_ad_rgb before the import"
        )

    class FabricusdCloth(mi.BSDF):  # type: ignore[misc]
        """A light that is reflected, component 0, and one that passes a gap, component 1."""

        def __init__(self, properties: Any) -> None:
            mi.BSDF.__init__(self, properties)
            path = str(mi.file_resolver().resolve(properties["filename"]))
            with open(path, encoding="utf-8") as file:
                try:
                    self.cloth = Cloth(json.load(file))
                except ValueError as error:
                    raise ValueError(f"{path} {error}") from error
            turn = float(properties.get("rotation", 0.0)) * dr.pi / 180.0
            self.cos, self.sin = dr.cos(turn), dr.sin(turn)
            both = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [
                mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.Anisotropic | both,
                mi.BSDFFlags.Null | both,
            ]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def _local(self, w: Any) -> Any:
            """Return a direction in the frame of weft and warp, on the upper side."""
            x, y = self.cos * w.x + self.sin * w.y, self.cos * w.y - self.sin * w.x
            return mi.Vector3f(x, y, dr.abs(w.z))

        def _chances(self, context: Any, view: Any) -> tuple[Any, Any]:
            """Return the chances of a reflection and of a gap."""
            reflects = context.is_enabled(mi.BSDFFlags.GlossyReflection, 0)
            passes = context.is_enabled(mi.BSDFFlags.Null, 1)
            gap = self.cloth.openness(view) if passes else mi.Float(0)
            if not reflects:
                return mi.Float(0), dr.select(gap > 0, mi.Float(1), mi.Float(0))
            return 1 - gap, gap

        def sample(self, context: Any, si: Any, one: Any, two: Any, active: Any = True) -> Any:
            view = self._local(si.wi)
            reflects, passes = self._chances(context, view)
            is_gap = one < passes
            go = mi.warp.square_to_cosine_hemisphere(two)
            out = mi.Vector3f(go.x, go.y, dr.mulsign(go.z, si.wi.z))
            sample = mi.BSDFSample3f()
            sample.wo = dr.select(is_gap, -si.wi, out)
            cosine = mi.warp.square_to_cosine_hemisphere_pdf(go)
            sample.pdf = dr.select(is_gap, passes, reflects * cosine)
            sample.eta = 1.0
            sample.sampled_component = dr.select(is_gap, mi.UInt32(1), mi.UInt32(0))
            sample.sampled_type = dr.select(
                is_gap, mi.UInt32(+mi.BSDFFlags.Null), mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            )
            reflected = self.cloth.value(self._local(out), view)
            through = mi.Color3f(self.cloth.openness(view))
            weight = dr.select(is_gap, through, reflected) / dr.maximum(sample.pdf, 1e-12)
            return sample, dr.select(active & (sample.pdf > 0), weight, 0)

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            if not context.is_enabled(mi.BSDFFlags.GlossyReflection, 0):
                return mi.Color3f(0)
            found = self.cloth.value(self._local(wo), self._local(si.wi))
            return dr.select(active & (si.wi.z * wo.z > 0), found, 0)

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            reflects, _ = self._chances(context, self._local(si.wi))
            same = active & (si.wi.z * wo.z > 0)
            return dr.select(same, reflects * dr.abs(wo.z) * dr.inv_pi, 0)

        def eval_pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

        def eval_null_transmission(self, si: Any, active: Any = True) -> Any:
            return mi.Color3f(self.cloth.openness(self._local(si.wi)))

        def to_string(self) -> str:
            return f"FabricusdCloth[{self.cloth.said['name']}, law {self.cloth.law}]"

    mi.register_bsdf("fabricusd_cloth", FabricusdCloth)


register()
