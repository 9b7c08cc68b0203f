"""Staging: domes, backgrounds, studios and cameras around a scene."""

from __future__ import annotations

import argparse
import math

import numpy as np
import pytest

from fabricusd.cli.arguments.staging import add_staging
from fabricusd.errors import FabricError
from fabricusd.fabric import SURFACE_LAWS, Binding
from fabricusd.images.files import write_exr, write_png
from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, PreviewSurface, Scene
from fabricusd.scene.staging import Staging, framed_meshes, over_background, put
from fabricusd.schema import load

TURN = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
"""A quarter about +y, counter-clockwise from above: x goes to -z, z goes to x."""


def mesh(path: str, at: tuple[float, float, float]) -> Mesh:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]) + at
    return Mesh(
        path=path, points=points, triangles=np.array([[0, 1, 2]]), material=np.zeros(1, np.int32)
    )


def scene(**changes) -> Scene:
    made = {
        "meshes": [mesh("/W/Coat/Front", (0, 0, 0)), mesh("/W/Coat/Back", (0, 0, -1)),
                   mesh("/W/Hat/Front", (0, 9, 0))],
        "materials": [PreviewSurface()],
        "lights": [Light(path="/Sky", kind=DOME, radiance=(1, 1, 1), camera_visible=True),
                   Light(path="/Sun", kind=DISTANT, radiance=(1, 1, 1))],
        "camera": Camera(path="/Cam"),
    }  # fmt: skip
    return Scene(**{**made, **changes})


def test_nothing_is_staged_unless_it_is_asked_for() -> None:
    before, after = scene(), scene()
    put(Staging(), after, 1.0)
    assert [light.path for light in after.lights] == [light.path for light in before.lights]
    assert after.camera.path == "/Cam"
    assert len(after.meshes) == 3


@pytest.mark.parametrize(
    ("frame", "paths"),
    [
        ("/", ["/W/Coat/Front", "/W/Coat/Back", "/W/Hat/Front"]),
        ("/W/Coat", ["/W/Coat/Front", "/W/Coat/Back"]),
        ("/W/Coat/Back", ["/W/Coat/Back"]),
        ("Coat", ["/W/Coat/Front", "/W/Coat/Back"]),
        ("Back", ["/W/Coat/Back"]),
    ],
)
def test_a_frame_is_a_path_or_a_name(frame: str, paths: list[str]) -> None:
    assert [each.path for each in framed_meshes(scene(), frame)] == paths


def test_a_frame_that_names_two_prims_or_none_is_refused() -> None:
    with pytest.raises(FabricError, match="--frame 'Front' is the name of several prims: /W/Coat/"):
        framed_meshes(scene(), "Front")
    with pytest.raises(FabricError, match=r"--frame 'Caot' is no mesh .*did you mean 'Coat'\?"):
        framed_meshes(scene(), "Caot")


def test_a_framed_camera_looks_as_before_and_sees_the_prim() -> None:
    staged = scene()
    put(Staging(frame="Hat"), staged, 1.0)
    assert staged.camera.frame[:3, :3] == pytest.approx(np.eye(3))
    local = staged.meshes[2].points - staged.camera.frame[:3, 3]
    assert np.all(np.abs(local[:, :2] / local[:, 2:]) <= 0.018 / 0.05)


def test_eye_and_look_at_place_the_camera() -> None:
    staged = scene()
    put(Staging(eye=(3, 0, 0), look_at=(0, 0, 0)), staged, 1.0)
    assert staged.camera.frame[:3, 3].tolist() == [3, 0, 0]
    assert staged.camera.frame[:3, 2] == pytest.approx([1, 0, 0])
    with pytest.raises(FabricError, match="--eye is where the camera looks"):
        put(Staging(eye=(3, 0, 0), look_at=(3, 0, 0)), scene(), 1.0)


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_an_orbit_goes_round_the_subject_and_keeps_its_distance(up: str) -> None:
    eyes = []
    for k in range(4):
        staged = scene(up_axis=up)
        put(Staging(frame="Coat", orbit=4), staged, 1.5, turn=math.tau * k / 4)
        eyes.append(staged.camera.frame[:3, 3])
        centre = np.array([0.5, 0.5, -0.5])
        towards = centre - eyes[-1]
        assert -staged.camera.frame[:3, 2] @ towards == pytest.approx(np.linalg.norm(towards))
    middle = np.mean(eyes, axis=0)
    axis = "XYZ".index(up)
    others = [k for k in range(3) if k != axis]
    assert middle[others] == pytest.approx(centre[others])
    assert len({round(float(np.linalg.norm(eye - centre)), 9) for eye in eyes}) == 1


def test_a_dome_replaces_the_domes_and_keeps_the_other_lights(tmp_path) -> None:
    sky = np.random.default_rng(0).random((8, 16, 3)).astype(np.float32)
    write_exr(tmp_path / "sky.exr", {"beauty": np.dstack((sky, np.ones((8, 16))))},
              {"beauty": ("R", "G", "B", "A")}, {})  # fmt: skip
    staged = scene()
    put(Staging(dome=tmp_path / "sky.exr", dome_rotation=math.pi / 2), staged, 1.0)
    assert [light.kind for light in staged.lights] == [DISTANT, DOME]
    dome = staged.lights[1]
    assert dome.image == pytest.approx(sky)
    assert dome.frame[:3, :3] == pytest.approx(TURN)
    assert dome.camera_visible


def test_a_dome_is_upright_where_z_is_up(tmp_path) -> None:
    write_png(tmp_path / "sky.png", np.full((4, 8, 3), 128, np.uint8))
    staged = scene(up_axis="Z")
    put(Staging(dome=tmp_path / "sky.png"), staged, 1.0)
    assert staged.lights[-1].frame[:3, 1] == pytest.approx([0, 0, 1])


def test_a_dome_that_is_no_picture_is_refused(tmp_path) -> None:
    (tmp_path / "sky.exr").write_text("no picture")
    with pytest.raises(FabricError, match=r"sky\.exr"):
        put(Staging(dome=tmp_path / "sky.exr"), scene(), 1.0)


def test_a_studio_replaces_the_lights_and_adds_a_backdrop() -> None:
    staged = scene()
    put(Staging(studio=True), staged, 1.0)
    assert all(light.path.startswith("studio") for light in staged.lights)
    assert staged.meshes[-1].path == "studio backdrop"
    assert staged.meshes[-1].points[:, 1].min() == pytest.approx(0)
    assert staged.camera.path == "/Cam"
    bare = scene(camera=None)
    put(Staging(studio=True), bare, 1.0)
    assert bare.camera is not None


def test_a_background_hides_the_domes_from_the_camera_alone() -> None:
    staged = scene()
    put(Staging(background=(1, 1, 1)), staged, 1.0)
    assert len(staged.lights) == 2
    assert all(light.hidden and not light.camera_visible for light in staged.lights)


def test_a_picture_over_a_background_is_opaque() -> None:
    beauty = np.array([[[0.0, 0, 0, 0], [0.5, 0.25, 0, 1], [0.2, 0.1, 0, 0.5]]], np.float32)
    laid = over_background(beauty, (1.0, 0.5, 0.0))
    assert laid == pytest.approx(
        np.array([[[1, 0.5, 0, 1], [0.5, 0.25, 0, 1], [0.7, 0.35, 0, 1]]]), abs=1e-6
    )


def test_every_fabric_and_its_back_wear_the_law_asked_for() -> None:
    satin = load("polyester_satin_charmeuse")
    grey, own = PreviewSurface(), FabricSurface(binding=Binding(fabric=satin, rotation=0.5))
    staged = scene(materials=[grey, own])
    put(Staging(surface_law="masked"), staged, 1.0)
    assert staged.materials[0] is grey
    binding = staged.materials[1].binding
    assert (binding.fabric.surface_law, binding.fabric.back.surface_law) == ("masked", "masked")
    assert binding.fabric.threads == satin.threads
    assert binding.rotation == 0.5
    assert own.binding.fabric.surface_law == "visible"


def test_a_law_that_a_fabric_cannot_wear_is_refused() -> None:
    linen = scene(materials=[FabricSurface(binding=Binding(fabric=load("linen_plain")))])
    with pytest.raises(FabricError, match="'facets', the law of conserving threads"):
        put(Staging(surface_law="facets"), linen, 1.0)


def test_the_option_offers_every_law() -> None:
    parser = argparse.ArgumentParser()
    add_staging(parser)
    offered = {a.dest: a.choices for a in parser._actions}["surface_law"]
    assert tuple(offered) == SURFACE_LAWS
