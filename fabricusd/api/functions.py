"""`bake`, `material`, `preview` and `fit`; docs/python.md has them in use."""

from __future__ import annotations

import os
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from fabricusd.errors import FabricError, did_you_mean

if TYPE_CHECKING:
    from fabricusd.bake.job import Baked
    from fabricusd.fabric import Fabric
    from fabricusd.materials.recipes import Written
    from fabricusd.measure import Fitted, Lobes
    from fabricusd.preview.picture import Picture

Source = str | os.PathLike[str]


def preview(
    fabric: Fabric | Source,
    *,
    shape: str = "cylinder",
    level: str | None = None,
    size: int = 512,
    samples: int | None = None,
) -> Picture:
    """Picture of a fabric on a shape, at once: one key light and a sky, no bounces.

    fabric : a Fabric, or the name of a preset or a file
    shape : one of `preview.shapes.SHAPES`: cylinder, sphere, drape, swatch, ...
    level : "far", "weave" or "thread"; None for `thread` on a swatch and `far` elsewhere
    size : of the picture along each side [pixels]; samples : per pixel, None for a usual number

    Raises FabricError for a file that cannot be read, an unknown shape or level, and for numbers
    out of their range.

    >>> import fabricusd
    >>> picture = fabricusd.preview("silk_shot", size=64)  # a notebook shows it
    >>> picture.codes().shape
    (64, 64, 3)
    """
    from fabricusd.fabric import Fabric
    from fabricusd.preview import picture

    cloth = fabric if isinstance(fabric, Fabric) else _loaded(fabric)
    return picture.preview(cloth, shape=shape, level=level, size=size, samples=samples)


def bake(
    scene: Source,
    out: Source,
    *,
    fabric: str | Fabric | None = None,
    mesh: str | None = None,
    units: str | None = None,
    resume: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    **settings: Any,
) -> Baked:
    """Bake every mesh of `scene` that wears a fabric: write textures and a report to `out`.

    fabric : of all meshes that bind none: a Fabric, or the name of a preset or a file
    mesh : path of a single mesh to bake; None bakes all
    units : of the lengths in an .obj or .ply: "m", "cm", "mm" or "in"
    resume : continue an interrupted bake of the same job
    workers, scheduler : threads of this process, or the address of a Dask cluster
    settings : fields of `bake.job.Settings`: resolution, texels_per_thread, maps, light, shadow,
        level, udim, fit, unwrap, max_error, btf, file_format, margin

    Raises FabricError, before anything is written, for what cannot be baked.

    >>> import fabricusd, tempfile
    >>> from fabricusd.samples.write import write_samples
    >>> folder = tempfile.mkdtemp()
    >>> skirt = str(write_samples(folder)[0])
    >>> made = fabricusd.bake(skirt, f"{folder}/baked", fabric="linen_plain", units="cm",
    ...                       fit=True, resolution=64, maps=("base_color",))
    >>> made.resolution, sorted(made.files["Skirt"])
    (64, ['base_color'])
    """
    from fabricusd.bake.bake import bake as baked
    from fabricusd.bake.job import Settings

    chosen = Settings(**_fields_of(Settings, settings))

    def portrait() -> Any:
        from fabricusd.preview.portrait import portrait as drawn

        return drawn(os.fspath(scene), fabric=fabric, units=units)

    return baked(
        scene, out, chosen, fabric=fabric, mesh=mesh, units=units, resume=resume, workers=workers,
        scheduler=scheduler, portrait=portrait,
    )  # fmt: skip


def material(
    bake: Source, out: Source | None = None, *, scene: Source | None = None,
    scheduler: str | None = None, **settings: Any,
) -> Written:  # fmt: skip
    """Write a look for a bake: a USD layer, a MaterialX document beside it, and a report.

    bake : folder that `fabricusd.bake` wrote; it is only read
    out : the layer to write, by default `look.usda` in that folder
    scene : the USD scene that was baked, to bind the look to its prims
    scheduler : address of the Dask cluster that does the fits; None for this process
    settings : fields of `materials.recipes.Settings`: surfaces, fitted, lobes, max_error, near,
        targets, colorway

    Raises FabricError if the folder holds no bake, or if the scene is not the one that was baked.

    >>> import fabricusd, tempfile
    >>> from fabricusd.samples.write import write_samples
    >>> folder = tempfile.mkdtemp()
    >>> skirt = str(write_samples(folder)[0])
    >>> made = fabricusd.bake(skirt, f"{folder}/baked", fabric="linen_plain", units="cm",
    ...                       fit=True, resolution=64)
    >>> look = fabricusd.material(f"{folder}/baked", fitted=False)
    >>> sorted(path.name for path in look.files if path.suffix in (".usda", ".mtlx"))
    ['look.mtlx', 'look.usda']
    """
    from fabricusd.materials.materials import write_materials
    from fabricusd.materials.recipes import Settings

    chosen = Settings(**_fields_of(Settings, settings))
    return write_materials(bake, out, chosen, scene=scene, scheduler=scheduler)


def fit(lobes: Lobes | Source, model: str = "microcylinder", **settings: Any) -> Fitted:
    """The thread whose scattering is nearest to measured lobes, with intervals of its numbers.

    lobes : Lobes, or a table of them that `fabricusd measure` wrote
    model : "thesis", "microcylinder" or "conserving"
    settings : gain, offset, lean, seed, workers and scheduler of `measure.fit_thread`

    The result's `thread` is a `Thread`: its angles are in radians.

    Raises FabricError for a table that cannot be read, and for too few views.

    >>> import fabricusd, numpy as np
    >>> from fabricusd.appearance.thread import evaluate
    >>> from fabricusd.measure import DESIGNS, Lobes
    >>> theta_i, theta_o, phi_d = DESIGNS["slice"]()
    >>> one = np.ones((len(theta_i), 3))
    >>> views = Lobes(theta_i=theta_i, theta_o=theta_o, phi_d=phi_d, f=one, sigma=0.01 * one)
    >>> true = fabricusd.Thread(gamma_surface=np.radians(15))
    >>> f = evaluate(true, views.wi, views.wo, "microcylinder")
    >>> found = fabricusd.fit(
    ...     Lobes(theta_i=theta_i, theta_o=theta_o, phi_d=phi_d, f=f, sigma=0.01 * one))
    >>> round(float(np.degrees(found.thread.gamma_surface)), 1)
    15.0
    """
    from fabricusd.measure import Lobes, fit_thread, read_lobes

    measured = lobes if isinstance(lobes, Lobes) else read_lobes(lobes)
    return fit_thread(measured, model, **settings)


def _loaded(source: Source) -> Fabric:
    from fabricusd.schema import load

    return load(source)


def _fields_of(kind: Any, given: dict[str, Any]) -> dict[str, Any]:
    """The settings that were given; FabricError for one that `kind` has not."""
    known = [one.name for one in fields(kind)]
    for name in given:
        if name not in known:
            hint = did_you_mean(name, known)
            raise FabricError(
                f"setting '{name}'", f"is unknown{hint}; it must be one of {', '.join(known)}"
            )
    return given
