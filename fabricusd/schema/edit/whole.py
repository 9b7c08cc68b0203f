"""A whole fabric as a variant of the one in a layer: the variant holds what it sets otherwise."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd, Vt

from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Fabric, Thread, ThreadSet
from fabricusd.files import whole_file
from fabricusd.schema import attributes
from fabricusd.schema.access import thread_prims
from fabricusd.schema.access import value as composed
from fabricusd.schema.attributes import DEGREE, Attribute, unscale
from fabricusd.schema.edit.dye import Value
from fabricusd.schema.edit.edit import author, format_of, held_in_file, named
from fabricusd.schema.edit.variant import Variant, names_of
from fabricusd.schema.findings import faults
from fabricusd.schema.source import find_fabric, no_warnings, open_stage, usd_errors
from fabricusd.schema.write import export, save
from fabricusd.weaves import rows as weave_rows


@reads("a fabric")
def save_variant(
    path: str | os.PathLike[str], name: str, fabric: Fabric, base: Fabric
) -> tuple[str, ...]:
    """Make `fabric` the variant `name`, or SET=NAME, of the fabric in a layer; what it sets there.

    base : the fabric that the layer is made of where there is no such file; `fabric` must have its
        threads

    The variant is selected. Nothing is written unless the result has no faults. Raises FabricError
    for a name that is none, for a layer that cannot be changed, and for a fabric with faults.
    """
    target = Path(path)
    names_of(name)
    with whole_file(target) as temporary:
        if target.exists():
            shutil.copyfile(target, temporary)
        else:
            save(base, temporary)
        try:
            return _set(temporary, name, fabric)
        except FabricError as error:
            # The temporary name would tell the reader nothing.
            said = str(error).replace(str(temporary), str(target))
            raise FabricError("", said) from error


def _set(path: Path, name: str, fabric: Fabric) -> tuple[str, ...]:
    stage, file = open_stage(path)
    layer = stage.GetRootLayer()
    try:
        with usd_errors(file, "changed"), no_warnings():
            prim = find_fabric(stage, file)
            threads = thread_prims(prim)
            if len(threads) != len(fabric.threads):
                raise FabricError(
                    f"{file}:{prim.GetPath()}",
                    f"has {len(threads)} threads; it must have {len(fabric.threads)}, as the "
                    "fabric to save has",
                )
            into = Variant(prim=prim, text=name)
            values = [v for v in _wanted(prim, threads, fabric) if _differs(v)]
            author(values, into)
            for each in (prim, *threads):
                for fault in faults(each):
                    raise FabricError(f"{fault.prim} {fault.property}".strip(), fault.problem)
            export(layer, file, format=format_of(path))
    finally:
        # The layer in memory is that of the whole process: it must be what the file is.
        layer.Reload(True)
    return tuple(f"{at.GetPath()} {spec.name}" for at, spec, _ in values)


def _differs(value: Value) -> bool:
    prim, spec, wanted = value
    found = composed(prim, spec.name)
    if hasattr(wanted, "__len__") and not isinstance(wanted, str):
        return list(found) != list(wanted)
    return bool(found != wanted)


def _wanted(prim: Usd.Prim, threads: Sequence[Usd.Prim], fabric: Fabric) -> Iterator[Value]:
    """Every number of the fabric, and its weave, as values of attributes."""
    for at, thread in zip(threads, fabric.threads.values(), strict=True):
        table: tuple[Attribute, ...] = attributes.THREAD
        if thread.target_basis == "none":
            table = tuple(entry for entry in table if entry.field != "target_color")
        yield from _all(at, (*table, attributes.TARGET_BASIS), thread, Thread)
        degrees = [unscale(a, DEGREE) for a in thread.curve.angles]
        for name, numbers in (("positions", thread.curve.positions), ("angles", degrees)):
            yield at, named(at, f"thread:curve:{name}")[0], Vt.DoubleArray(numbers)
    for which, threads_of in (("warp", fabric.warp), ("weft", fabric.weft)):
        yield from _all(prim, attributes.thread_set(which), threads_of, ThreadSet)
    rows = weave_rows.from_cells(fabric.weave.cells)
    for name, value in (
        ("fabric:weave:rows", Vt.StringArray(rows)), ("fabric:weave:name", fabric.weave.name)
    ):  # fmt: skip
        spec: Sdf.AttributeSpec = named(prim, name)[0]
        yield prim, spec, value


def _all(prim: Usd.Prim, table: tuple[Attribute, ...], owner: Any, kind: type) -> Iterator[Value]:
    for entry in table:
        yield held_in_file(prim, table, entry.field, getattr(owner, entry.field), kind)
