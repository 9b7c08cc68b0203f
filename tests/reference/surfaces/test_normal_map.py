"""Normal maps: the frame they make, the light they catch, and that they let none through."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.reference.surfaces.normal_map import LEAST_FACING, mapped_frame
from fabricusd.scene.light_kinds import DOME, RECT
from fabricusd.scene.scene import Camera, Light, PreviewSurface, Texture
from tests.reference.scenes import (
    above,
    grid,
    lambert,
    looking,
    picture,
    sun,
    worst_z,
    z_limit,
)

WHITE_DOME = Light(path="dome", kind=DOME, radiance=(1.0, 1.0, 1.0))
NORMAL = np.array([0.48, -0.36, 0.8])
"""A normal tilted by 37 degrees, to the right and down."""


def mapped(surface: PreviewSurface, normals: np.ndarray, **where) -> PreviewSurface:
    """`surface` with a normal map of (3,) or (h, w, 3) normals."""
    pixels = np.asarray(normals, np.float32).reshape(*np.shape(normals)[:-1] or (1, 1), 3)
    return replace(surface, textures={"normal": Texture(pixels=pixels, **where)})


part = st.floats(-1, 1, width=32)


@settings(max_examples=300, deadline=None)
@given(part, part, part, part, part, st.floats(2**-13, 1, width=32), st.sampled_from([-1.0, 1.0]))
def test_a_mapped_frame_is_orthonormal_and_faces_the_viewer(x, y, z, ox, oy, oz, side):
    r = np.float32
    o = np.array([ox, oy, oz]) / np.linalg.norm([ox, oy, oz])
    frame = np.reshape(mapped_frame(r(x), r(y), r(z), r(side), *o.astype(r)), (3, 3))
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=2e-5)
    assert np.linalg.det(frame) == pytest.approx(1, abs=2e-5)
    assert frame[2] @ o >= min(LEAST_FACING, o[2]) - 1e-6
    n = np.array([side * x, y, z])
    length = np.linalg.norm(n)
    if length > 1e-3 and n @ o / length > LEAST_FACING:
        assert frame[2] == pytest.approx(n / length, abs=2e-5)
    if length == 0:
        assert frame[2] == pytest.approx([0, 0, 1], abs=float(LEAST_FACING))


SUNS = {
    # name: towards the sun, of a plane seen from above
    "from above": (0.0, 1.0, 0.0),
    "along the mapped normal": (0.48, 0.8, 0.36),
    "from where the map turns away": (-0.96, 0.28, 0.0),
    "from below the plane, above the map": (0.96, -0.28, 0.0),
}


def _lit_from(towards: tuple[float, ...], normal: np.ndarray | None, side: int = 1) -> np.ndarray:
    """A plane under the sun, seen from above; on its back all is mirrored in the origin."""
    surface = lambert(0.5) if normal is None else mapped(lambert(0.5), normal)
    camera = replace(above(), frame=looking((0.0, 2.0 * side, 0.0)))
    light = sun(np.multiply(towards, side))
    return picture([grid()], [surface], [light], camera, spp=4).layers["beauty"][..., :3]


def _tilted(towards: tuple[float, ...]) -> float:
    """Radiance of a Lambert plane that is tilted as NORMAL is, where the sun is above the plane."""
    # In the world u grows along +x, v along -z.
    normal = np.array([NORMAL[0], NORMAL[2], -NORMAL[1]])
    return 0.5 / math.pi * max(float(normal @ towards), 0.0) * (towards[1] > 0)


@pytest.mark.parametrize("name", SUNS)
@pytest.mark.parametrize("side", [1, -1], ids=["front", "back"])
def test_a_tilted_map_catches_the_light_of_a_tilted_plane(name, side):
    shown = _lit_from(SUNS[name], NORMAL, side)
    assert shown == pytest.approx(_tilted(SUNS[name]), abs=1e-6)


@pytest.mark.parametrize("name", [name for name, towards in SUNS.items() if towards[1] > 0])
def test_without_the_map_or_with_green_inverted_the_plane_is_lit_otherwise(name):
    towards = SUNS[name]
    assert abs(_lit_from(towards, None).mean() - _tilted(towards)) > 0.02
    if towards[2] != 0:
        assert abs(_lit_from(towards, NORMAL * [1, -1, 1]).mean() - _tilted(towards)) > 0.02


TURNS = {
    # name: (3, 3) what the mesh's UVs are of (x, -z, 1)
    "as the mesh": [[1, 0, 0], [0, 1, 0]],
    "mirrored": [[-1, 0, 0.3], [0, 1, 0]],
    "upside down": [[1, 0, 0], [0, -1, 0]],
    "a quarter turn": [[0, -1, 0], [1, 0, 0]],
    "turned and mirrored": [[0.6, 0.8, 0], [0.8, -0.6, 0]],
    "stretched": [[3, 0, 0], [0, 0.5, 0]],
    "large": [[800, -600, 5e4], [600, 800, -5e4]],
}


def _world(along: np.ndarray, mirrored: float, texel: np.ndarray) -> np.ndarray:
    """A texel's normal in the world of a plane seen from above, whose u grows along `along` =
    (x, -z)."""
    across = mirrored * np.array([-along[1], along[0]])
    x, minus_z = texel[0] * along + texel[1] * across
    return np.array([x, texel[2], -minus_z])


@pytest.mark.parametrize("name", TURNS)
@pytest.mark.parametrize("by", ["mesh", "texture"])
def test_turned_and_mirrored_uvs_turn_the_relief_with_them(name, by):
    turn = np.array(TURNS[name], float)
    mesh, place = grid(cells=3), (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    if by == "mesh":
        mesh = replace(mesh, uv=mesh.uv @ turn[:, :2].T + turn[:, 2])
    else:
        place = tuple(turn.ravel())
    inverse = np.linalg.inv(turn[:, :2])
    along = inverse[:, 0] / np.linalg.norm(inverse[:, 0])
    expected = _world(along, np.sign(np.linalg.det(inverse)), NORMAL)
    r = picture(
        [mesh], [mapped(lambert(0.5), NORMAL, place=place)], [sun()], above(), spp=4,
        aovs=("beauty", "normal"),
    )  # fmt: skip
    assert r.layers["normal"] == pytest.approx(np.broadcast_to(expected, (16, 16, 3)), abs=2e-5)
    assert r.layers["beauty"][..., 0] == pytest.approx(0.5 / math.pi * expected[1], abs=1e-6)


def test_a_ridge_is_bright_on_the_side_of_the_light():
    """Normals of a roof whose ridge runs along v: the side of small u faces small u."""
    roof = np.array([[[-0.6, 0, 0.8], [0.6, 0, 0.8]]])
    r = picture(
        [grid(size=1.0)], [mapped(lambert(0.5), roof, place=(1, 0, 0.5, 0, 1, 0),
                                   wrap=("clamp", "clamp"))],
        [sun((-0.6, 0.8, 0))], above(width=0.9), spp=4,
    )  # fmt: skip
    left, right = r.layers["beauty"][:, 2, 0].mean(), r.layers["beauty"][:, -3, 0].mean()
    assert left == pytest.approx(0.5 / math.pi, rel=1e-4)
    assert right == pytest.approx(0.5 / math.pi * (0.64 - 0.36), rel=1e-4)


@pytest.mark.parametrize("tilt", [20, 60, 85])
@pytest.mark.parametrize("estimator", ["mis", "light", "surface", "uniform"])
def test_a_tilted_map_in_a_white_dome_sees_what_is_above_its_plane(tilt, estimator):
    a = math.radians(tilt)
    white = mapped(lambert(1.0), np.array([math.sin(a), 0, math.cos(a)]))
    r = picture([grid()], [white], [WHITE_DOME], above(), spp=256, estimator=estimator)
    mean = r.layers["beauty"][..., :3].mean(axis=(0, 1))
    error = np.sqrt(r.layers["variance"].mean(axis=(0, 1)) / 256)
    # [Howell]: a plane at this angle to another sees so much of the sky over both.
    assert np.all(np.abs(mean - (1 + math.cos(a)) / 2) < 4.5 * error + 2e-4)


@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.1, 0.6])
def test_no_map_makes_a_surface_brighter_than_the_dome_around_it(metallic, roughness):
    glossy = PreviewSurface(diffuse=(1, 1, 1), metallic=metallic, roughness=roughness)
    camera = Camera(frame=looking((3.0, 0.5, 1.0)), orthographic=True, aperture=(0.2, 0.2))
    r = picture([grid()], [mapped(glossy, rough_normals())], [WHITE_DOME], camera, spp=256)
    assert r.not_finite == 0
    mean = r.layers["beauty"][..., :3].mean(axis=(0, 1))
    error = np.sqrt(r.layers["variance"].mean(axis=(0, 1)) / 256)
    assert np.all(mean < 1 + 4.5 * error)
    assert np.all(mean > 0.4)


def rough_normals() -> np.ndarray:
    """(16, 16, 3) normals in all directions of the hemisphere, some of them below it."""
    n = np.random.default_rng(7).normal(size=(16, 16, 3))
    n[..., 2] = np.abs(n[..., 2]) - 0.1
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


SURFACES = {
    "dull": lambert(0.7),
    "glossy": PreviewSurface(diffuse=(0.6, 0.3, 0.1), roughness=0.4),
    "metal": PreviewSurface(diffuse=(0.9, 0.6, 0.3), metallic=1.0, roughness=0.5),
    "see-through": PreviewSurface(diffuse=(0.6, 0.3, 0.1), roughness=0.4, opacity=0.6),
}


@pytest.mark.parametrize("name", SURFACES)
def test_estimators_agree_on_folds_with_a_rough_normal_map(name):
    made = {e: _folds(SURFACES[name], e) for e in ("mis", "light", "surface", "uniform")}
    limit = z_limit(3 * 16 * 3 * len(SURFACES))
    for estimator in ("light", "surface", "uniform"):
        assert made[estimator].not_finite == 0
        assert worst_z(made["mis"], made[estimator]) < limit, estimator


def test_the_comparison_of_estimators_would_see_a_map_turned_by_a_tenth():
    less = rough_normals() * [0.9, 0.9, 1.0]
    a = _folds(SURFACES["glossy"], "mis")
    b = _folds(SURFACES["glossy"], "light", less)
    assert worst_z(a, b, count=1) > z_limit(3 * 16 * 3 * len(SURFACES))


def _folds(surface: PreviewSurface, estimator: str, normals: np.ndarray | None = None):
    normals = rough_normals() if normals is None else normals
    folds = grid(lambda x, z: 0.12 * np.sin(9 * x) * np.cos(5 * z), cells=40)
    floor = replace(grid(size=3.0, material=1), path="floor")
    floor = replace(floor, points=floor.points - [0.0, 0.3, 0.0])
    image = np.random.default_rng(3).uniform(0.2, 1.0, (8, 16, 3)).astype(np.float32)
    lights = [
        Light(path="dome", kind=DOME, radiance=(1, 1, 1), image=image),
        Light(
            path="box", kind=RECT, width=0.8, height=0.8, radiance=(6, 6, 6),
            frame=looking((0.6, 1.0, 0.4)),
        ),
    ]  # fmt: skip
    camera = Camera(frame=looking((0.7, 1.4, 1.0)), aperture=(0.03, 0.03))
    return picture(
        [folds, floor], [mapped(surface, normals), lambert(0.6)], lights, camera, size=32, spp=64,
        estimator=estimator, max_bounces=3, seed=5,
    )  # fmt: skip


def test_a_map_of_the_surface_s_own_normal_changes_no_picture():
    plain, flat = SURFACES["glossy"], mapped(SURFACES["glossy"], np.array([0, 0, 1]))
    folds = grid(lambda x, z: 0.3 * np.sin(9 * x), cells=20)
    camera = Camera(frame=looking((1.2, 0.2, 0.2)), aperture=(0.03, 0.03))
    a, b = (picture([folds], [m], [sun(), WHITE_DOME], camera, spp=16) for m in (plain, flat))
    assert np.abs(a.layers["beauty"] - b.layers["beauty"]).max() < 1e-4
