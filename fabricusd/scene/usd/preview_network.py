"""Reads UsdPreviewSurface networks: constants, textures, and the placement of textures."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdShade

from fabricusd.errors import FabricError
from fabricusd.images.files import read_alpha, read_image
from fabricusd.scene.scene import PreviewSurface, Scene, Texture
from fabricusd.scene.usd.asset import asset_file

_LARGEST = 4096
"""Most pixels along a side of a texture, with all its tiles; larger textures are shrunk."""

_MOST_TRANSFORMS = 8
"""Most UsdTransform2d nodes in a chain; a longer chain is taken for a cycle."""


COLOR, NUMBER, VECTOR = "a colour", "a number", "a vector of three numbers"
"""The kinds of inputs."""


class _Input(NamedTuple):
    field: str
    kind: str
    low: float
    high: float
    textured: bool

    @property
    def size(self) -> int:
        """How many numbers the input holds."""
        return 1 if self.kind == NUMBER else 3


_INPUTS = {
    "diffuseColor": _Input("diffuse", COLOR, 0.0, 100.0, True),
    "emissiveColor": _Input("emissive", COLOR, 0.0, 1e12, True),
    "metallic": _Input("metallic", NUMBER, 0.0, 1.0, True),
    "roughness": _Input("roughness", NUMBER, 0.0, 1.0, True),
    "ior": _Input("ior", NUMBER, 0.01, 100.0, False),
    "opacity": _Input("opacity", NUMBER, 0.0, 1.0, True),
    "opacityThreshold": _Input("opacity_threshold", NUMBER, 0.0, 1.0, False),
    "normal": _Input("normal", VECTOR, -1e3, 1e3, True),
}
"""The inputs that are rendered, and their bounds. The bounds of colours keep the weights of paths,
and those of normals their squares, within the range of 32-bit numbers."""

_LEFT_OUT = {"clearcoat": 0.0, "displacement": 0.0}
"""Inputs that are not rendered, and the value at which they have no effect."""

_FLAT = (0.0, 0.0, 1.0)
"""The normal that leaves the surface as it is."""

_MODES = ("repeat", "clamp", "mirror", "black")

_OPACITY_MODES = ("transparent", "presence")

_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}


class PreviewNetwork:
    """The network of one material. Where an input cannot be read, a note says so and its default is
    rendered."""

    def __init__(self, material: UsdShade.Material, time: Usd.TimeCode, scene: Scene) -> None:
        self.material, self.time, self.scene = material, time, scene
        self.where = str(material.GetPath())
        self.uv_set = ""

    def read(self) -> tuple[PreviewSurface, str]:
        """The surface, and the UV set that its textures read, "" for any."""
        shader, _, _ = self.material.ComputeSurfaceSource()
        if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface":
            self._note("has no UsdPreviewSurface; it is rendered grey")
            return PreviewSurface(name=self.where), ""
        values: dict[str, Any] = {}
        textures: dict[str, Texture] = {}
        for name, row in _INPUTS.items():
            source, output = self._source(shader, name)
            if isinstance(source, UsdShade.Shader):
                texture = self._texture(name, row, source, output)
                if texture is not None:
                    textures[row.field] = texture
            elif source is not None:
                values[row.field] = self._constant(name, row, source)
        self._keep_normal(values, textures)
        self._note_left_out(shader)
        self._thin_sheet(values, textures)
        known = {field: value for field, value in values.items() if value is not None}
        return PreviewSurface(name=self.where, textures=textures, **known), self.uv_set

    def _thin_sheet(self, values: dict[str, Any], textures: dict[str, Texture]) -> None:
        """Read the light through a thin sheet that a look of fabricusd has beside its preview.

        UsdPreviewSurface has none. In the look's MaterialX network it is the node `through_scaled`:
        an image or a colour times the material's `transmission_scale`.
        """
        node = UsdShade.Shader(self.material.GetPrim().GetChild("through_scaled"))
        given = self.material.GetInput("transmission_scale")
        if not node or not given:
            return
        row = _Input("transmission", COLOR, 0.0, 1.0, True)
        scale = _numbers(given.Get(self.time), 3)
        source, _ = self._source(node, "in1")
        if scale is None:
            self._note(f"has transmission_scale {given.Get(self.time)}; it must be {COLOR}, and no "
                       "light comes through")  # fmt: skip
        elif isinstance(source, UsdShade.Shader):
            try:
                pixels, tiles = self._pixels(source, True, None)
            except FabricError as error:
                self._note(f"lets no light through: {error}")
                return
            found = self._sound(
                "transmission_color", row, pixels[..., :3] * scale.astype(np.float32)
            )
            place = np.eye(3) if tiles is None else tiles
            wrap = "clamp" if tiles is None else "black"
            textures[row.field] = Texture(
                pixels=found, wrap=(wrap, wrap), place=tuple(place[:2].ravel())
            )
        elif source is not None and (color := _numbers(source, 3)) is not None:
            values[row.field] = tuple(float(x) for x in np.clip(color * scale, 0.0, 1.0))

    def _note(self, problem: str) -> None:
        self.scene.note(self.where, problem)

    def _keep_normal(self, values: dict[str, Any], textures: dict[str, Texture]) -> None:
        """Make a constant normal a texture of one texel: both need the mesh's UVs."""
        constant = values.pop("normal", None) or _FLAT
        if not any(constant):
            self._note("has a normal of length 0; the surface's own is rendered")
        elif constant != _FLAT:
            textures["normal"] = Texture(pixels=np.array([[constant]], np.float32))

    def _note_left_out(self, shader: UsdShade.Shader) -> None:
        left_out = []
        for name, nothing in _LEFT_OUT.items():
            source, _ = self._source(shader, name)
            if source is not None and source != nothing:
                left_out.append(name)
        if left_out:
            self._note(f"has {', '.join(left_out)}, left out")
        self._note_opacity(shader)
        if self._source(shader, "useSpecularWorkflow")[0] == 1:
            self._note("asks for the specular workflow; the metallic one is rendered")

    def _note_opacity(self, shader: UsdShade.Shader) -> None:
        """Opacity is rendered as the share of the surface that is there: `presence`."""
        mode = str(self._source(shader, "opacityMode")[0] or "transparent")
        opacity = self._source(shader, "opacity")[0]
        threshold = self._source(shader, "opacityThreshold")[0]
        if mode not in _OPACITY_MODES:
            self._note(f"has opacityMode '{mode}'; it must be one of {', '.join(_OPACITY_MODES)}")
        elif mode == "transparent" and opacity not in (None, 0, 1) and not threshold:
            self._note(
                "has an opacity of opacityMode 'transparent', rendered as 'presence': its "
                "reflection fades with it"
            )

    def _source(self, shader: UsdShade.Shader, name: str) -> tuple[Any, str]:
        """(value, "") of an input, or (shader, name of the output) of what it is connected to."""
        given = shader.GetInput(name)
        if not given:
            return None, ""
        for attribute in UsdShade.Utils.GetValueProducingAttributes(given):
            producer = UsdShade.Shader(attribute.GetPrim())
            if UsdShade.Output.IsOutput(attribute) and producer:
                return producer, str(UsdShade.Output(attribute).GetBaseName())
            return attribute.Get(self.time), ""
        return None, ""

    def _constant(self, name: str, row: _Input, given: Any) -> Any:
        """One number or three, within the bounds of the input; None for any other value."""
        values = _numbers(given, row.size)
        if values is None:
            self._note(f"has {name} {given}; it must be {row.kind}, and its default is rendered")
            return None
        inside = np.clip(values, row.low, row.high)
        if (inside != values).any():
            low, high = f"{row.low:g}", f"{row.high:g}"
            self._note(f"has {name} {given}; it must be from {low} to {high}, and is cut off there")
        return tuple(float(x) for x in inside) if row.size == 3 else float(inside[0])

    def _texture(
        self, name: str, row: _Input, node: UsdShade.Shader, output: str
    ) -> Texture | None:
        """The picture of a UsdUVTexture, of one channel or three."""
        kind = node.GetIdAttr().Get()
        if kind != "UsdUVTexture" or not row.textured:
            self._note(f"reads {name} from a node of the kind '{kind}'; its default is rendered")
            return None
        channel = _CHANNELS.get(output, None if row.size == 3 else 0)
        place, wrap = self._coordinates(node), self._wrap(node)
        try:
            pixels, tiles = self._pixels(node, row.kind == COLOR, channel)
        except FabricError as error:
            self._note(f"is rendered without a texture: {error}")
            fallback = self._four(node, "fallback", math.nan)
            picked = fallback[:3] if channel is None else fallback[channel : channel + 1]
            if not np.isfinite(picked).all():
                return None
            pixels, tiles = picked.reshape(1, 1, -1), None
        else:
            codes, pixels = pixels, self._scaled(node, pixels, channel)
            if row.kind == VECTOR:
                if codes.shape[2] != 3:
                    self._note(f"reads {name} from one channel; it must have three (connect 'rgb' "
                               "of a colour picture), and its default is rendered")  # fmt: skip
                    return None
                pixels = self._normals(node, codes, pixels)
        if tiles is not None:
            place, wrap = tiles @ place, ("black", "black")
        return Texture(
            pixels=self._sound(name, row, pixels), wrap=wrap, place=tuple(place[:2].ravel())
        )

    def _pixels(
        self, node: UsdShade.Shader, color: bool, channel: int | None
    ) -> tuple[NDArray[np.float32], NDArray[np.float64] | None]:
        """(h, w, c) pixels; for UDIM tiles also the (3, 3) matrix from UVs to their picture."""
        given = node.GetInput("file")
        attributes = UsdShade.Utils.GetValueProducingAttributes(given) if given else []
        asset = attributes[0].Get(self.time) if attributes else None
        if not isinstance(asset, Sdf.AssetPath) or not asset.path:
            raise FabricError(f"{node.GetPath()} inputs:file", "names no asset; it must name one")
        space = str(self._source(node, "sourceColorSpace")[0] or "auto")

        def read(file: str, most: int) -> NDArray[np.float32]:
            if channel == _CHANNELS["a"]:
                return read_alpha(file, most=most)
            # Data is taken as linear unless the texture names another colour space.
            kind = "raw" if space == "auto" and not color else space
            pixels = read_image(file, color_space=kind, most=most)
            return (
                pixels if channel is None else pixels[..., min(channel, pixels.shape[2] - 1), None]
            )

        if UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            layer = attributes[0].GetPropertyStack(self.time)[0].layer
            found = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, layer)
            if not found:
                raise FabricError(asset.path, "has no tiles; 1001 or another must be there")
            return _tile_picture([(int(tile) - 1001, path) for path, tile in found], read)
        with asset_file(asset) as file:
            return read(file, _LARGEST), None

    def _four(self, node: UsdShade.Shader, name: str, otherwise: float) -> NDArray[np.float32]:
        """Four numbers of a texture's input; all `otherwise` where it is missing or mistyped."""
        given, _ = self._source(node, name)
        values = None if given is None else _numbers(given, 4)
        if given is not None and values is None:
            self._note(
                f"has a texture with {name} {given}; it must be four numbers, and is ignored"
            )
        return np.full(4, otherwise, np.float32) if values is None else values.astype(np.float32)

    def _scaled(
        self, node: UsdShade.Shader, pixels: NDArray[np.float32], channel: int | None
    ) -> NDArray[np.float32]:
        scale, bias = self._four(node, "scale", 1.0), self._four(node, "bias", 0.0)
        if (scale == 1).all() and (bias == 0).all():
            return pixels
        which = slice(0, 3) if channel is None else slice(channel, channel + 1)
        return pixels * scale[which] + bias[which]

    def _normals(
        self, node: UsdShade.Shader, codes: NDArray[np.float32], normals: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """`normals`, with 0 for no normal where the picture is black: there nothing was painted, or
        a UDIM tile is missing. A note tells of a picture that does not look like a normal map.

        codes : (h, w, 3) - the picture's values before scale and bias
        """
        if str(self._source(node, "sourceColorSpace")[0]) == "sRGB":
            self._note("decodes its normal map as sRGB; normals are data, and should be 'raw'")
        if (self._four(node, "bias", 0.0)[:3] == 0).all() and (normals >= 0).all() and (
            normals[..., :2] > 0
        ).any():  # fmt: skip
            self._note("has a normal map without a bias that holds no negative number; codes need "
                       "scale (2, 2, 2, 1) and bias (-1, -1, -1, 0)")  # fmt: skip
        return np.where(codes.any(axis=2, keepdims=True), normals, np.float32(0))

    def _sound(self, name: str, row: _Input, pixels: NDArray[np.float32]) -> NDArray[np.float32]:
        finite = np.isfinite(pixels)
        if not finite.all():
            self._note(f"has {int((~finite).sum())} values in the texture of {name} that are not "
                       "finite; they are taken as 0")  # fmt: skip
            pixels = np.where(finite, pixels, 0.0)
        return np.ascontiguousarray(np.clip(pixels, row.low, row.high), np.float32)

    def _wrap(self, node: UsdShade.Shader) -> tuple[str, str]:
        return self._mode(node, "wrapS"), self._mode(node, "wrapT")

    def _mode(self, node: UsdShade.Shader, name: str) -> str:
        mode = str(self._source(node, name)[0] or "repeat")
        if mode in _MODES:
            return mode
        if mode != "useMetadata":
            self._note(f"has {name} '{mode}'; it must be one of {', '.join(_MODES)}; it repeats")
        return "repeat"

    def _coordinates(self, node: UsdShade.Shader) -> NDArray[np.float64]:
        """(3, 3) from the mesh's UVs to the texture's; stores the UV set's name in `uv_set`."""
        place = np.eye(3)
        reader, _ = self._source(node, "st")
        for _ in range(_MOST_TRANSFORMS):
            if not isinstance(reader, UsdShade.Shader):
                return place
            kind = reader.GetIdAttr().Get()
            if kind != "UsdTransform2d":
                break
            place = place @ self._transform(reader)
            reader, _ = self._source(reader, "in")
        if kind != "UsdPrimvarReader_float2":
            self._note(f"reads UVs from a node of the kind '{kind}'; the mesh's own are taken")
            return place
        name = str(self._source(reader, "varname")[0] or "")
        if self.uv_set and name and name != self.uv_set:
            self._note(f"reads the UV sets '{self.uv_set}' and '{name}'; the second is taken")
        self.uv_set = name or self.uv_set
        return place

    def _transform(self, node: UsdShade.Shader) -> NDArray[np.float64]:
        """(3, 3) matrix of a UsdTransform2d, which scales, turns counter-clockwise, then moves."""
        found = []
        for name, count, otherwise in (("scale", 2, 1.0), ("rotation", 1, 0.0),
                                       ("translation", 2, 0.0)):  # fmt: skip
            given, _ = self._source(node, name)
            values = None if given is None else _numbers(given, count)
            found.append(np.full(count, otherwise) if values is None else values)
        scale, turn, move = found[0], math.radians(found[1][0]), found[2]
        c, s = math.cos(turn), math.sin(turn)
        return np.array(
            [[c * scale[0], -s * scale[1], move[0]], [s * scale[0], c * scale[1], move[1]],
             [0.0, 0.0, 1.0]]
        )  # fmt: skip


def _numbers(given: Any, count: int) -> NDArray[np.float64] | None:
    """`count` finite numbers; None where `given` is anything else."""
    try:
        values = np.array(given, np.float64)
    except (TypeError, ValueError):
        return None
    if values.shape != ((count,) if count > 1 else ()) or not np.isfinite(values).all():
        return None
    return values.reshape(count)


def _tile_picture(
    tiles: list[tuple[int, str]], read: Any
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """One picture of all tiles, black where one is missing, and the (3, 3) matrix from UVs to it.

    tiles : (number of the tile from 0, its file); ten tiles make a row, and rows go upwards
    """
    columns, rows = np.array([n % 10 for n, _ in tiles]), np.array([n // 10 for n, _ in tiles])
    left, bottom = int(columns.min()), int(rows.min())
    across, up = int(columns.max()) - left + 1, int(rows.max()) - bottom + 1
    pictures = []
    for _, path in tiles:
        with asset_file(Sdf.AssetPath(path, path)) as file:
            pictures.append(read(file, _LARGEST // max(across, up)))
    h, w, c = np.max([picture.shape for picture in pictures], axis=0)
    total = np.zeros((up * h, across * w, c), np.float32)
    for picture, column, row in zip(pictures, columns - left, rows - bottom, strict=True):
        y, x = np.arange(h) * picture.shape[0] // h, np.arange(w) * picture.shape[1] // w
        top = (up - 1 - row) * h
        total[top : top + h, column * w : (column + 1) * w] = picture[y[:, None], x]
    return total, np.array(
        [[1 / across, 0.0, -left / across], [0.0, 1 / up, -bottom / up], [0.0, 0.0, 1.0]]
    )
