"""Pictures on a local Dask cluster beside threads: overhead, bytes moved, sameness to the bit.

    python bench/farm/bench_farm.py [--workers 1 2 4] [--size 256] [--spp 64] [--repeat 3]

Prints a table: for threads of this process, and for clusters of so many processes, the wall time of
sampling one picture when everything is prepared, the bytes that jobs and results took, the time of
a job on its worker, and whether the picture is the same to the bit. Two more lines extrapolate: the
longest time that one job holds up the end of a round, and how many workers the client can feed.
"""

from __future__ import annotations

import argparse
import pickle
import statistics
import time
from typing import Any

import numpy as np

from fabricusd.fabric import Binding
from fabricusd.reference import farm
from fabricusd.reference.render import RenderResult, render_scene
from fabricusd.run.cluster import Cluster, open_cluster
from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, Scene
from fabricusd.schema import load


def scene() -> Scene:
    """A square metre of linen, seen from half a metre away, under a sky and a sun."""
    points = np.array([[-0.5, 0, -0.5], [0.5, 0, -0.5], [0.5, 0, 0.5], [-0.5, 0, 0.5]])
    triangles = np.array([[0, 2, 1], [0, 3, 2]])
    uv = points[:, [0, 2]][triangles]
    linen = Binding(fabric=load("linen_plain"), threads_per_uv=(1600.0, 1600.0))
    frame = np.array([[1, 0, 0, 0], [0, 0, 1, 0.5], [0, -1, 0, 0], [0, 0, 0, 1]], float)
    mesh = Mesh(path="square", points=points, triangles=triangles, uv=uv, material=np.zeros(2, int))
    lights = [
        Light(path="sky", kind=DOME, radiance=(0.4, 0.5, 0.6)),
        Light(path="sun", kind=DISTANT, radiance=(2.0, 1.8, 1.5), angle=0.01),
    ]
    return Scene(
        meshes=[mesh], materials=[FabricSurface(binding=linen)], lights=lights,
        camera=Camera(frame=frame),
    )  # fmt: skip


class Watched(Cluster):
    """A cluster that counts the bytes of jobs and results, and the seconds of jobs."""

    sent = 0
    came = 0
    shared = 0
    jobs: list[float]

    def run(self, function: Any, shared: Any, jobs: Any, done: Any, stop: Any = None) -> bool:
        """As `Cluster.run`."""
        import cloudpickle

        self.shared = len(cloudpickle.dumps(shared))

        def told(k: int, result: farm.Traced) -> None:
            self.came += len(pickle.dumps(result))
            self.sent += len(cloudpickle.dumps(jobs[k]))
            self.jobs.append(result.seconds)
            done(k, result)

        return super().run(function, shared, jobs, told, stop)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    how: dict[str, Any] = {"width": given.size, "height": given.size, "spp": given.spp}

    def median(**more: Any) -> tuple[float, RenderResult]:
        render_scene(scene(), **how, **more)
        found = [render_scene(scene(), **how, **more) for _ in range(given.repeat)]
        return statistics.median(one.seconds for one in found), found[-1]

    base, picture = median(workers=given.threads)
    print(f"{given.size} x {given.size}, {given.spp} samples, median of {given.repeat}")
    print("| workers | s | to threads | MB sent | MB back | s a job | same |")
    print("|---|---|---|---|---|---|---|")
    print(f"| {given.threads} threads | {base:.2f} | 1 | | | | |")
    for count in given.workers:
        with open_cluster(f"local:{count}") as opened:
            watched = Watched(opened.client, opened.scheduler)
            watched.jobs = []
            seconds, found = median(cluster=watched)
            rounds = given.repeat + 1
            same = all(
                np.array_equal(layer, picture.layers[name]) for name, layer in found.layers.items()
            )
            job = statistics.median(watched.jobs)
            print(
                f"| {count} processes | {seconds:.2f} | {seconds / base:.2f} | "
                f"{watched.sent / rounds / 1e6:.2f} | {watched.came / rounds / 1e6:.2f} | "
                f"{job:.3f} | {'yes' if same else 'NO'} |"
            )
            begun = time.perf_counter()
            for _ in range(50):
                opened.client.submit(abs, -1, pure=False).result()
            trip = (time.perf_counter() - begun) / 50
            per_job = (watched.sent + watched.came) / max(len(watched.jobs), 1)
            print(
                f"  shared once a worker: {watched.shared / 1e6:.2f} MB; a job moves "
                f"{per_job / 1e3:.0f} kB and takes {job:.3f} s; an empty job takes "
                f"{1e3 * trip:.1f} ms: a thousand busy workers would move "
                f"{1000 * per_job / job / 1e6:.0f} MB/s"
            )


if __name__ == "__main__":
    main()
