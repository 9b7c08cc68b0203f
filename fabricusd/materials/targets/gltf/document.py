"""A glTF document in the making: buffers, textures and materials. pygltflib knows the format."""

from __future__ import annotations

import hashlib
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd import __version__
from fabricusd.errors import FabricError
from fabricusd.images.files import write_png
from fabricusd.materials.targets.gltf.corners import Vertices

MISSING = "needs pygltflib; install it with: pip install 'fabricusd[gltf]'"


def require_pygltflib() -> Any:
    """The module that writes glTF; FabricError where it is not installed."""
    try:
        import pygltflib
    except ImportError as error:
        raise FabricError("--glb", MISSING) from error
    return pygltflib


class Document:
    """Collects the parts of one binary glTF file. Equal pictures are stored once."""

    def __init__(self) -> None:
        self.lib = require_pygltflib()
        self.gltf = self.lib.GLTF2(asset=self.lib.Asset(generator=f"fabricusd {__version__}"))
        self.gltf.scene = 0
        self.gltf.scenes = [self.lib.Scene(nodes=[])]
        self._data = bytearray()
        self._textures: dict[bytes, int] = {}
        self._extensions: set[str] = set()

    def used(self, name: str) -> str:
        """Name an extension that the document uses; none is required."""
        self._extensions.add(name)
        return name

    def texture(self, codes: NDArray[np.uint8], name: str, *, color: bool) -> dict[str, int]:
        """A reference to a texture of 8-bit code values (h, w, c), clamped at its border.

        color : whether red, green and blue are sRGB rather than data
        """
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "picture.png"
            write_png(file, codes, color_space="sRGB" if color else "raw")
            data = file.read_bytes()
        key = hashlib.blake2b(data, digest_size=16).digest()
        if key not in self._textures:
            view = self._view(data, None)
            self.gltf.images.append(
                self.lib.Image(bufferView=view, mimeType=self.lib.IMAGEPNG, name=name)
            )
            if not self.gltf.samplers:
                clamp = self.lib.CLAMP_TO_EDGE
                self.gltf.samplers.append(
                    self.lib.Sampler(
                        magFilter=self.lib.LINEAR, minFilter=self.lib.LINEAR_MIPMAP_LINEAR,
                        wrapS=clamp, wrapT=clamp,
                    )
                )  # fmt: skip
            self._textures[key] = len(self.gltf.textures)
            source = len(self.gltf.images) - 1
            self.gltf.textures.append(self.lib.Texture(source=source, sampler=0, name=name))
        return {"index": self._textures[key]}

    def material(self, **fields: Any) -> int:
        """Add a material; return its number."""
        self.gltf.materials.append(self.lib.Material(**fields))
        return len(self.gltf.materials) - 1

    def primitive(self, vertices: Vertices, material: int, variants: dict[int, int]) -> Any:
        """A primitive in `material`, and in other materials by the number of their variant."""
        lib = self.lib
        attributes = lib.Attributes(
            POSITION=self._accessor(vertices.position, bounds=True),
            NORMAL=self._accessor(vertices.normal),
            TANGENT=self._accessor(vertices.tangent),
            TEXCOORD_0=self._accessor(vertices.uv),
        )
        wide = len(vertices.position) > 65535
        flat = vertices.triangles.ravel().astype(np.uint32 if wide else np.uint16)
        made = lib.Primitive(attributes=attributes, indices=self._accessor(flat), material=material)
        if variants:
            mappings: dict[int, list[int]] = {}
            for variant, worn in variants.items():
                mappings.setdefault(worn, []).append(variant)
            made.extensions[self.used("KHR_materials_variants")] = {
                "mappings": [{"material": k, "variants": v} for k, v in mappings.items()]
            }
        return made

    def mesh(self, name: str, primitives: list[Any]) -> None:
        """Add a mesh of primitives, and a node that shows it."""
        self.gltf.meshes.append(self.lib.Mesh(name=name, primitives=primitives))
        self.gltf.nodes.append(self.lib.Node(name=name, mesh=len(self.gltf.meshes) - 1))
        self.gltf.scenes[0].nodes.append(len(self.gltf.nodes) - 1)

    def variants(self, names: list[str]) -> None:
        """State the variants of the document, in the order of their numbers."""
        told = {"variants": [{"name": name} for name in names]}
        self.gltf.extensions[self.used("KHR_materials_variants")] = told

    def to_bytes(self) -> bytes:
        """The file."""
        self.gltf.extensionsUsed = sorted(self._extensions)
        self._data += bytes(-len(self._data) % 4)
        self.gltf.buffers = [self.lib.Buffer(byteLength=len(self._data))]
        self.gltf.set_binary_blob(bytes(self._data))
        return b"".join(self.gltf.save_to_bytes())

    def _accessor(self, values: NDArray[Any], *, bounds: bool = False) -> int:
        lib = self.lib
        kinds = {np.dtype(np.float32): lib.FLOAT, np.dtype(np.uint32): lib.UNSIGNED_INT,
                 np.dtype(np.uint16): lib.UNSIGNED_SHORT}  # fmt: skip
        index = values.ndim == 1
        target = lib.ELEMENT_ARRAY_BUFFER if index else lib.ARRAY_BUFFER
        made = lib.Accessor(
            bufferView=self._view(np.ascontiguousarray(values).tobytes(), target),
            componentType=kinds[values.dtype], count=len(values),
            type=lib.SCALAR if index else f"VEC{values.shape[1]}",
        )  # fmt: skip
        if bounds:
            made.min, made.max = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        self.gltf.accessors.append(made)
        return len(self.gltf.accessors) - 1

    def _view(self, data: bytes, target: int | None) -> int:
        self._data += bytes(-len(self._data) % 4)
        self.gltf.bufferViews.append(
            self.lib.BufferView(
                buffer=0, byteOffset=len(self._data), byteLength=len(data), target=target
            )
        )
        self._data += data
        return len(self.gltf.bufferViews) - 1
