"""The garment as one binary glTF 2.0 file: geometry, textures, and the look's variants.

The numbers are those of the fit of MaterialX's `gltf_pbr`, which is glTF's own model. glTF has no
layers or instances of fabrics: each mesh, fabric and UDIM tile becomes a primitive.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from fabricusd.errors import FabricError
from fabricusd.files import require_writable, whole_file
from fabricusd.images.files import read_mip_level, shape_of
from fabricusd.materials.bake_folder import BakedLay, MapSet
from fabricusd.materials.fit.spanning import lobe_level
from fabricusd.materials.networks.graph import Texture
from fabricusd.materials.networks.surfaces import Inputs
from fabricusd.materials.targets import Job
from fabricusd.materials.targets.gltf.corners import (
    Corners,
    Vertices,
    baked_corners,
    parts,
    placed_corners,
    vertices,
)
from fabricusd.materials.targets.gltf.document import Document, require_pygltflib
from fabricusd.materials.targets.gltf.layers import alpha_mode, layers_of, of_tile
from fabricusd.materials.targets.gltf.material import cloth, plain
from fabricusd.materials.targets.layer import VARIANT_SET
from fabricusd.scene.scene import PreviewSurface, Scene
from fabricusd.scene.usd.preview_network import PreviewNetwork

BAKED, THROUGH, PROCEDURAL, OFF = "baked", "baked_translucent", "procedural", "off"
"""Names of the variants, the look's own; `baked_translucent` also lets light through the cloth."""

VARIANTS = (BAKED, THROUGH, PROCEDURAL, OFF)

REACH = 1e-5
"""UV by which a triangle may reach beyond its tile unnoticed."""


def check(where: Path, clobber: bool) -> None:
    """Raise FabricError if the suffix is not .glb, or the file cannot be written."""
    if where.suffix != ".glb":
        raise FabricError(f"--glb '{where}'", f"has the suffix '{where.suffix}'; it must be .glb")
    require_pygltflib()
    require_writable(where, clobber=clobber)


def folder(look: Path, where: Path) -> Path:
    """Return the file's folder."""
    return where.parent


def write(job: Job, where: Path) -> list[Path]:
    """Write the file alone."""
    if job.progress:
        job.progress(f"writing {where.name}")
    stage = Usd.Stage.Open(str(job.look))
    maker = _Maker(job, stage)
    for maps in job.garments:
        for name, corners in _meshes(job, maps, where):
            maker.add(maps, name, corners)
    data = maker.finish()
    with whole_file(where, clobber=job.clobber) as temporary:
        temporary.write_bytes(data)
    return [where]


def _meshes(job: Job, maps: MapSet, where: Path) -> Iterator[tuple[str, Corners]]:
    """Yield the name and the corners of each mesh that wears the textures."""
    placed = [path for path in maps.prims if path in job.placed]
    for path in placed:
        name = maps.name if len(placed) == 1 else path.strip("/").replace("/", "_")
        yield name, placed_corners(job.placed[path], maps)
    if not placed:
        yield maps.name, baked_corners(maps)
        if len(maps.prims) > 1:
            job.note(
                f"{where} holds {maps.name} once; {len(maps.prims)} meshes wear its textures, and "
                "with --scene all of them are in the file"
            )


class _Maker:
    """Makes the materials of a look on demand, and the primitives that wear them."""

    def __init__(self, job: Job, stage: Usd.Stage) -> None:
        self.job, self.stage = job, stage
        self.document = Document()
        self.up_axis = str(UsdGeom.GetStageUpAxis(stage))
        self._meshes: list[tuple[str, list[tuple[Vertices, dict[str, int]]]]] = []
        self._materials: dict[tuple[str, int, int], dict[str, int]] = {}
        self._off: dict[str, int] = {}

    def add(self, maps: MapSet, name: str, corners: Corners) -> None:
        """Add a mesh: a primitive for each fabric and tile."""
        made = []
        crossing = 0
        for lay, tile, part in parts(corners, udim=maps.udim):
            made.append((vertices(part, up_axis=self.up_axis), self._worn(maps, lay, tile)))
            outside = (part.uv < -REACH) | (part.uv > 1.0 + REACH)
            crossing += int(outside.any(axis=(1, 2)).sum())
        self._meshes.append((name, made))
        if crossing:
            self.job.note(
                f"{name} has {crossing} triangles that cross UDIM tiles; glTF has no tiles, so "
                "each shows the tile of its middle, whose border goes on beyond"
            )

    def finish(self) -> bytes:
        """Write what was added. A mesh that lacks a variant shows the baked material in it."""
        worn_by_any = {variant for _, made in self._meshes for _, worn in made for variant in worn}
        shown = [one for one in VARIANTS if one in worn_by_any]
        for name, made in self._meshes:
            primitives = [
                self.document.primitive(
                    one, worn[BAKED], {k: worn.get(v, worn[BAKED]) for k, v in enumerate(shown)}
                )
                for one, worn in made
            ]
            self.document.mesh(name, primitives)
        self.document.variants(shown)
        return self.document.to_bytes()

    def _worn(self, maps: MapSet, lay: int, tile: int) -> dict[str, int]:
        """The materials of a fabric on a garment, by variant."""
        key = maps.name, lay, tile
        if key not in self._materials:
            self._materials[key] = self._made(maps, lay, tile)
        return self._materials[key]

    def _made(self, maps: MapSet, lay: int, tile: int) -> dict[str, int]:
        found = {}
        for variant in (BAKED, PROCEDURAL):
            recipe = self.job.recipes[maps.name, lay, variant]
            name = recipe.name if not maps.udim else f"{recipe.name}_{tile}"
            look = recipe.looks["gltf_pbr"]
            normals = maps.textures.get("normal", {}).get(tile)
            level = _lobe_level(recipe.inputs, maps.lays[lay], tile)
            layers = layers_of(recipe.inputs, look, tile, normals=normals, level=level)
            worn = _worn_texels(maps, lay, tile, layers.cover)
            mode = alpha_mode(layers.cover[worn], opaque=recipe.opaque)
            found[variant] = cloth(self.document, name, layers, look, mode)
            if variant == BAKED and layers.through is not None:
                found[THROUGH] = cloth(
                    self.document, f"{name}_translucent", layers, look, mode, through=True
                )
        off = self._without_fabric(maps)
        if off is not None:
            found[OFF] = off
        return found

    def _without_fabric(self, maps: MapSet) -> int | None:
        """What the scene's own material is, None where the look has no scene."""
        path = next((path for path in maps.prims if path in self.job.placed), None)
        prim = self.stage.GetPrimAtPath(path) if path else None
        if not prim:
            return None
        with Usd.EditContext(self.stage, self.stage.GetSessionLayer()):
            root = self.stage.GetPrimAtPath(prim.GetPath().GetPrefixes()[0])
            root.GetVariantSets().SetSelection(VARIANT_SET, OFF)
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        surface = PreviewSurface()
        if material:
            surface, _ = PreviewNetwork(material, Usd.TimeCode.Default(), Scene()).read()
        key = material.GetPath().name if material else "grey"
        if key not in self._off:
            self._off[key] = plain(self.document, key, surface)
        return self._off[key]


def _lobe_level(inputs: Inputs, lay: BakedLay, tile: int) -> int:
    """The level of a look's own maps; 0 where the look has taken it already."""
    source = inputs["roughness_along"]
    if not isinstance(source, Texture):
        return 0
    return lobe_level(lay.matrix, shape_of(of_tile(source, tile))[1])


def _worn_texels(maps: MapSet, lay: int, tile: int, cover: NDArray[Any]) -> NDArray[np.bool_]:
    """(h, w) texels of `cover` that the fabric has."""
    if cover.shape[:2] == (1, 1):
        return np.ones((1, 1), bool)
    if tile in maps.textures.get("lay", {}):
        mine = read_mip_level(maps.textures["lay"][tile])[..., 0] == lay
    elif tile in maps.textures.get("normal", {}):
        mine = np.linalg.norm(read_mip_level(maps.textures["normal"][tile]), axis=-1) > 0.5
    else:
        return np.ones(cover.shape[:2], bool)
    return mine if mine.any() else np.ones(cover.shape[:2], bool)
