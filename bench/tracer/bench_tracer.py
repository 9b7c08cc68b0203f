"""Time of the path tracer relative to that of Embree alone with the same rays, in one run.

    python bench/tracer/bench_tracer.py [--level auto] [--spp 16] [--size 1024] [--workers 2]

The scene is the draped cloth of `samples`, about 100 k triangles, with four bounces. All packets of
rays of every sixteenth batch are kept. Afterwards Embree traces them again with nothing in between,
with as many workers, and its time is scaled to the number of rays of the whole picture: once with
the flags of the tracer, which trace camera rays coherently, and once with Embree's default, which
traces every ray on its own. On a busy machine, trust the processor time, which is summed over
workers and includes building the scene.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.reference.integrator import Tracer
from fabricusd.reference.rays.embree import Accelerator, aligned_empty
from fabricusd.reference.render import render_scene
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import FabricSurface, PreviewSurface, Scene

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
EVERY = 16


class _Keeper:
    """Keeps copies of the packets that go to Embree, for one batch in EVERY."""

    def __init__(self) -> None:
        self.kept: list[tuple[str, Any, int, dict[str, bool]]] = []
        self.rays = 0
        self.batch = threading.local()
        self.accelerator: Accelerator | None = None

    def install(self) -> None:
        trace, keep = Tracer.trace, self
        begun = iter(range(1 << 62))

        def kept_trace(tracer: Tracer, *arguments: Any) -> None:
            keep.accelerator = tracer.accelerator
            keep.batch.chosen = next(begun) % EVERY == 0
            trace(tracer, *arguments)

        Tracer.trace = kept_trace  # type: ignore[method-assign]
        for name in ("intersect", "occluded"):
            self._wrap(name)

    def _wrap(self, name: str) -> None:
        call = getattr(Accelerator, name)

        def kept_call(accelerator: Accelerator, rays: Any, count: int, **how: bool) -> None:
            if getattr(self.batch, "chosen", False):
                self.kept.append((name, rays[:count].copy(), count, how))
                self.rays += 16 * count
            call(accelerator, rays, count, **how)

        setattr(Accelerator, name, kept_call)


def aligned_copy(rays: Any) -> Any:
    """A copy, aligned so that Embree can read it."""
    copy = aligned_empty(rays.shape)
    copy[:] = rays
    return copy


def embree_alone(keeper: _Keeper, workers: int, *, as_asked: bool) -> tuple[float, float]:
    """(wall time, processor time) [s] of Embree for the packets kept, shared among the workers.

    as_asked : trace with the flags of the tracer, else with none
    """
    accelerator = keeper.accelerator
    assert accelerator is not None
    best = (float("inf"), float("inf"))
    for _ in range(3):
        left = [(name, aligned_copy(rays), count, how) for name, rays, count, how in keeper.kept]
        lock = threading.Lock()

        def work(left: list[Any] = left, lock: threading.Lock = lock) -> None:
            while True:
                with lock:
                    if not left:
                        return
                    name, rays, count, how = left.pop()
                getattr(accelerator, name)(rays, count, **(how if as_asked else {}))

        threads = [threading.Thread(target=work) for _ in range(workers)]
        begun, used = time.perf_counter(), time.process_time()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        best = min(best, (time.perf_counter() - begun, time.process_time() - used))
    return best


def drape(fabric: str) -> Scene:
    """The scene of the sample; if `fabric` is "lambert", the cloth is a diffuse surface."""
    sys.path.insert(0, str(SAMPLES))
    from make_samples import make_drape

    with tempfile.TemporaryDirectory() as folder:
        scene = read_scene(make_drape(Path(folder), steps=120))
    if fabric == "lambert":
        scene.materials = [
            PreviewSurface(diffuse=(0.5, 0.5, 0.5), ior=1.0) if isinstance(m, FabricSurface) else m
            for m in scene.materials
        ]
    return scene


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--level", default="auto")
    parser.add_argument("--fabric", default="silk_shot", help="silk_shot or lambert")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    scene = drape(options.fabric)
    settings = {"width": options.size, "height": options.size, "level": options.level,
                "workers": options.workers, "max_bounces": 4}  # fmt: skip
    render_scene(scene, **{**settings, "width": 64, "height": 64}, spp=16)
    plain, used = float("inf"), float("inf")
    for _ in range(3):
        begun = time.process_time()
        result = render_scene(scene, **settings, spp=options.spp)
        plain, used = min(plain, result.seconds), min(used, time.process_time() - begun)
    keeper = _Keeper()
    keeper.install()
    result = render_scene(scene, **settings, spp=options.spp)
    lanes = sum(int(np.count_nonzero(rays[:, 8] >= rays[:, 3])) for _, rays, _, _ in keeper.kept)
    print(f"{result.metadata['fabricusd:triangles']} triangles, {result.rays / 1e6:.1f} M rays")
    print(f"path tracer {plain:.2f} s wall, {used:.2f} s of processors")
    for as_asked, name in ((True, "as the tracer asks"), (False, "by its default")):
        alone = embree_alone(keeper, options.workers, as_asked=as_asked)
        wall, processors = (seconds * result.rays / lanes for seconds in alone)
        print(
            f"Embree alone {name}: {wall:.2f} s wall, {plain / wall:.2f} times; "
            f"{processors:.2f} s of processors, {used / processors:.2f} times"
        )


if __name__ == "__main__":
    main()
