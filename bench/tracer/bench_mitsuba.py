"""Compare the path tracer with Mitsuba 3 (`llvm_ad_rgb`), which gets the law as a Python plugin.

    pip install 'fabricusd[mitsuba]'; apt-get install libllvm19
    python bench/tracer/bench_mitsuba.py [--size 512] [--spp 16]

The scene is the draped cloth of `samples` in the microcylinder model and the law `masked` at level
`far`, over a diffuse floor, with the same lights, camera, box filter and depth for both. The plugin
evaluates the same nodes of the same tables and samples by cosine, as users would write it; Mitsuba
uses the sampler `multijitter`. Only sampling is timed: scenes are built and kernels compiled
before.

Printed are the times, as medians over pictures; relative MSE against the mean of twice as many
other pictures by the same renderer, on the cloth alone and on the whole picture, also as medians,
since a single firefly of the plugin may be a hundred times the rest; and the time to the same
error, which is proportional to the product of the two. Last comes the ratio of the pictures' means,
also under each kind of light alone. In Mitsuba, a lamp is an obstacle that hides part of the sky;
in our renderer it is not.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench_tracer import drape

from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering.columns import (
    ALBEDO_R,
    IOR_EXCESS,
    ISOTROPIC,
    SURFACE_LOBE,
    VOLUME_LOBE,
)
from fabricusd.reference.rays.triangles import N, build_tables
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import FabricSurface, Light, PreviewSurface, Scene

DEPTH = 4
PICTURES = 9
SMALL = 96
"""Width of the pictures whose means are compared."""


def far_law(fabric: Any, dr: Any, mi: Any) -> Any:
    """`far.far_value` under the law `masked` as a function of two directions, one term per node:
    `model.md` section 4."""
    tables = surface_tables(fabric, precision=np.float32)
    if tables.nodes[:, 3].any():
        raise SystemExit("the plugin has nodes that are points only")

    def masked(x: Any, y: Any, u: Any) -> Any:
        return x * y + u * (dr.minimum(x, y) - x * y)

    def overlap(s: Any, c: Any) -> Any:
        half = dr.acos(dr.minimum(0.5 * dr.sqrt(s * s + c * c), 1.0))
        return dr.exp(-float(tables.precision) * half * half)

    def fresnel(excess: float, c: Any) -> Any:
        c = dr.maximum(c, 1e-12)
        g = dr.sqrt(excess + c * c)
        inverse, p = 1 / ((c + g) * (c + g)), c + excess * c
        inverse_p = 1 / ((p + g) * (p + g))
        r_s = excess * inverse
        reflected = 0.5 * (r_s * r_s + (p - g) * (p - g) * inverse_p)
        return reflected, 2 * g * (c * inverse + p * inverse_p)

    def node(k: int, row: Any, i: Any, o: Any) -> Any:
        """(weight P, surface, volume) of one tangent angle; i, o : (along, across, up, scale)."""
        c, s, weight = (float(x) for x in tables.nodes[k, :3])
        t_i, n_i = c * i[0] - s * i[2], s * i[0] + c * i[2]
        t_o, n_o = c * o[0] - s * o[2], s * o[0] + c * o[2]
        cos_i, cos_o = dr.sqrt(i[1] * i[1] + n_i * n_i), dr.sqrt(o[1] * o[1] + n_o * n_o)
        inv_i, inv_o = 1 / dr.maximum(cos_i, 1e-30), 1 / dr.maximum(cos_o, 1e-30)
        sine, cosine = i[1] * inv_i + o[1] * inv_o, n_i * inv_i + n_o * inv_o
        cos_half = 0.5 * dr.sqrt(sine * sine + cosine * cosine)
        m = masked(
            dr.maximum(n_i * inv_i, 0), dr.maximum(n_o * inv_o, 0), overlap(sine, cosine)
        ) * cos_i  # fmt: skip
        sum_s, sum_c = t_i + t_o, cos_i + cos_o
        cos2_d = 0.25 * (sum_s * sum_s + sum_c * sum_c)
        theta_h = dr.atan2(sum_s, sum_c)
        reflected, once = fresnel(float(row[IOR_EXCESS]), dr.sqrt(cos2_d) * cos_half)
        lobes = [
            float(row[at + 1]) * dr.exp(-float(row[at]) * theta_h * theta_h)
            for at in (SURFACE_LOBE, VOLUME_LOBE)
        ]
        kd, compressed = float(row[ISOTROPIC]), 1 / dr.maximum(cos2_d, 1e-6)
        surface = reflected * cos_half * lobes[0] * compressed
        volume = once * once * ((1 - kd) * lobes[1] + kd) * compressed
        volume /= dr.maximum(sum_c, 1e-6)
        p = weight * masked(dr.maximum(n_i, 0) * i[3], dr.maximum(n_o, 0) * o[3], i[4])
        return p, m * surface, m * volume

    def value(wi: Any, wo: Any) -> Any:
        q, total = float(tables.gap) * wo.z, mi.Color3f(0)
        for first, last, warp in (
            (0, tables.warp_start, False), (tables.warp_start, len(tables.nodes), True)
        ):  # fmt: skip
            sides = []
            for w in (wi, wo):
                along, across = (w.y, -w.x) if warp else (w.x, w.y)
                sides.append([along, across, w.z, dr.rsqrt(along * along + w.z * w.z)])
            (a, _, z, s), (b, _, y, t) = sides
            sides[0].append(overlap(a * s + b * t, z * s + y * t))
            for k in range(first, last):
                row = tables.threads[tables.node_thread[k]]
                p, surface, volume = node(k, row, *sides)
                q += p
                total += p * (surface + volume * mi.Color3f(*map(float, row[ALBEDO_R:][:3])))
        return dr.select((wi.z > 0) & (wo.z > 0) & (q > 1e-12), total / q, 0)

    return value


def define_plugin(mi: Any, dr: Any, fabric: Any) -> None:
    """The plugin `cloth`: the law on both sides, sampled by cosine."""
    law = far_law(fabric, dr, mi)

    class Cloth(mi.BSDF):  # type: ignore[misc]
        def __init__(self, properties: Any) -> None:
            mi.BSDF.__init__(self, properties)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components, self.m_flags = [flags], flags

        def sample(self, context: Any, si: Any, one: Any, two: Any, active: Any) -> Any:
            go = mi.warp.square_to_cosine_hemisphere(two)
            pdf = mi.warp.square_to_cosine_hemisphere_pdf(go)
            seen = mi.Vector3f(si.wi.x, si.wi.y, dr.abs(si.wi.z))
            sample = mi.BSDFSample3f()
            sample.wo = mi.Vector3f(go.x, go.y, dr.mulsign(go.z, si.wi.z))
            sample.pdf, sample.eta, sample.sampled_component = pdf, 1.0, 0
            sample.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            active &= pdf > 0
            return sample, dr.select(active, law(go, seen) / pdf, 0)

        def eval(self, context: Any, si: Any, wo: Any, active: Any) -> Any:
            same = si.wi.z * wo.z > 0
            light = mi.Vector3f(wo.x, wo.y, dr.abs(wo.z))
            seen = mi.Vector3f(si.wi.x, si.wi.y, dr.abs(si.wi.z))
            return dr.select(active & same, law(light, seen), 0)

        def pdf(self, context: Any, si: Any, wo: Any, active: Any) -> Any:
            return dr.select(active & (si.wi.z * wo.z > 0), dr.abs(wo.z) * dr.inv_pi, 0)

        def eval_pdf(self, context: Any, si: Any, wo: Any, active: Any) -> Any:
            return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

        def to_string(self) -> str:
            return "Cloth[]"

    mi.register_bsdf("cloth", Cloth)


def mitsuba_scene(mi: Any, scene: Scene, size: int, folder: Path) -> Any:
    """Mitsuba's scene with the same triangles, lights and camera."""
    tables = build_tables(scene)
    parts: dict[str, Any] = {"type": "scene"}
    parts["integrator"] = {"type": "path", "max_depth": DEPTH + 2}
    for k, surface in enumerate(scene.materials):
        mine = tables.material == k
        if not mine.any():
            continue
        corners = tables.points[tables.triangles[mine]].reshape(-1, 3)
        mesh = mi.Mesh(
            f"m{k}", len(corners), int(mine.sum()), has_vertex_normals=True,
            has_vertex_texcoords=True,
        )  # fmt: skip
        data = mi.traverse(mesh)
        data["vertex_positions"] = corners.ravel()
        data["vertex_normals"] = tables.records[mine, N : N + 9].ravel()
        data["vertex_texcoords"] = tables.uv[mine].ravel()
        data["faces"] = np.arange(len(corners), dtype=np.uint32)
        data.update()
        mesh.write_ply(str(folder / f"{k}.ply"))
        if isinstance(surface, FabricSurface):
            law: dict[str, Any] = {"type": "cloth"}
        else:
            color = {"type": "rgb", "value": list(surface.diffuse)}
            law = {"type": "twosided", "inner": {"type": "diffuse", "reflectance": color}}
        parts[f"m{k}"] = {"type": "ply", "filename": str(folder / f"{k}.ply"), "bsdf": law}
    for k, light in enumerate(scene.lights):
        radiance = {"type": "rgb", "value": [float(x) for x in light.radiance]}
        if light.kind == DOME:
            parts[f"l{k}"] = {"type": "constant", "radiance": radiance}
            continue
        frame = _moved(light.frame, tables.centre) @ np.diag(
            [light.width / 2, -light.height / 2, -1, 1]
        )
        parts[f"l{k}"] = {
            "type": "rectangle", "to_world": mi.ScalarTransform4f(frame),
            "emitter": {"type": "area", "radiance": radiance},
        }  # fmt: skip
    camera = scene.camera
    assert camera is not None
    parts["sensor"] = {
        "type": "perspective", "fov_axis": "x",
        "fov": float(np.degrees(2 * np.arctan(camera.aperture[0] / 2 / camera.focal_length))),
        "to_world": mi.ScalarTransform4f(
            _moved(camera.frame, tables.centre) @ np.diag([-1.0, 1, -1, 1])
        ),
        "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
        "sampler": {"type": "multijitter", "sample_count": 16},
    }  # fmt: skip
    return mi.load_dict(parts)


def _moved(frame: Any, centre: Any) -> Any:
    moved = frame.copy()
    moved[:3, 3] -= centre
    return moved


def plain_scene() -> Scene:
    """The draped cloth in the microcylinder model and the law `masked`, over a diffuse floor."""
    scene = drape("silk_shot")
    law = {"model": "microcylinder", "surface_law": "masked", "back": None}
    scene.materials = [
        FabricSurface(
            name=m.name,
            binding=replace(m.binding, fabric=replace(m.binding.fabric, **law)),
        )
        if isinstance(m, FabricSurface)
        else PreviewSurface(diffuse=m.diffuse, ior=1.0)
        for m in scene.materials
    ]
    return scene


def cloth_mask(scene: Scene, size: int) -> Any:
    """(h, w) bool: pixels that show cloth alone."""
    red, green = (PreviewSurface(diffuse=c, ior=1.0) for c in ((1.0, 0, 0), (0, 1.0, 0)))
    shown = replace(
        scene, lights=[Light(kind=DOME, path="", radiance=(1.0, 1.0, 1.0))],
        materials=[red if isinstance(m, FabricSurface) else green for m in scene.materials],
    )  # fmt: skip
    layers = render_scene(
        shown, width=size, height=size, spp=16, max_bounces=0, pixel_filter="box"
    ).layers
    return layers["beauty"][..., 1] == 0


def ours(scene: Scene, size: int, workers: int, seed: int, spp: int) -> tuple[Any, float, float]:
    """(picture by fabricusd, wall time, processor time of sampling it) [s]."""
    result = render_scene(
        scene, width=size, height=size, spp=spp, max_bounces=DEPTH, level="far", seed=seed,
        workers=workers, pixel_filter="box",
    )  # fmt: skip
    picture = result.layers["beauty"][..., :3].astype(float)
    return picture, result.seconds, result.processor_seconds


def theirs(mi: Any, loaded: Any, seed: int, spp: int) -> tuple[Any, float, float]:
    """The same by Mitsuba, for a scene that is loaded."""
    begun, used = time.perf_counter(), time.process_time()
    picture = np.array(mi.render(loaded, spp=spp, seed=seed)).astype(float)
    return picture, time.perf_counter() - begun, time.process_time() - used


def mean_ratio(mi: Any, scene: Scene, workers: int) -> float:
    """Mean of our picture over the mean of Mitsuba's, for small pictures of many samples."""
    with tempfile.TemporaryDirectory() as folder:
        loaded = mitsuba_scene(mi, scene, SMALL, Path(folder))
    mean = np.mean([theirs(mi, loaded, seed, 64)[0].mean() for seed in range(8)])
    return float(ours(scene, SMALL, workers, 3, 512)[0].mean() / mean)


def relative_errors(picture: Any, exact: Any) -> Any:
    """(h, w) squared error over the squared picture, which is at least a hundredth of its mean."""
    return ((picture - exact) ** 2 / (exact**2 + (0.01 * exact.mean()) ** 2)).mean(axis=-1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    if importlib.util.find_spec("mitsuba") is None:
        print("mitsuba is not installed; pip install 'fabricusd[mitsuba]'")
        return
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(options.workers)
    scene = plain_scene()
    define_plugin(
        mi, dr, next(m for m in scene.materials if isinstance(m, FabricSurface)).binding.fabric
    )
    size, spp, workers = options.size, options.spp, options.workers
    with tempfile.TemporaryDirectory() as folder:
        loaded = mitsuba_scene(mi, scene, size, Path(folder))
    cloth = cloth_mask(scene, size)
    times, errors = [], []
    for name, draw in (
        ("fabricusd", lambda seed: ours(scene, size, workers, seed, spp)),
        ("mitsuba", lambda seed: theirs(mi, loaded, seed, spp)),
    ):
        draw(9)
        drawn = [draw(seed) for seed in range(PICTURES)]
        exact = np.mean([draw(100 + k)[0] for k in range(2 * PICTURES)], axis=0)
        wall, used = (float(np.median([d[k] for d in drawn])) for k in (1, 2))
        off = [relative_errors(picture, exact) for picture, _, _ in drawn]
        times.append(used)
        errors.append([float(np.median([e[w].mean() for e in off])) for w in (cloth, cloth | True)])
        print(
            f"{name}: wall {wall:.2f} s, processors {used:.2f} s, relMSE {errors[-1][0]:.5f} on "
            f"cloth ({cloth.mean():.0%} of the picture), {errors[-1][1]:.5f} on all"
        )
    ratio = times[0] / times[1]
    print(f"processor time, fabricusd over mitsuba: {ratio:.2f}")
    for k, where in enumerate(("the cloth", "all")):
        print(f"to the same relMSE on {where}: {ratio * errors[0][k] / errors[1][k]:.3f}")
    lights = scene.lights
    for name, some in (
        ("all lights", lights),
        ("the sky alone", [light for light in lights if light.kind == DOME]),
        ("the lamps alone", [light for light in lights if light.kind != DOME]),
    ):
        scene.lights = some
        print(f"means, fabricusd over mitsuba, {name}: {mean_ratio(mi, scene, workers):.4f}")


if __name__ == "__main__":
    main()
