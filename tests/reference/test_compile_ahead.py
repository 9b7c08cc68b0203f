"""What the second process compiles on a machine's first picture is what the picture needs."""

from __future__ import annotations

from fabricusd.fabric import Binding
from fabricusd.reference.compile_ahead import compile_shading
from fabricusd.reference.departures import depart
from fabricusd.reference.far_shading import shade_far
from fabricusd.reference.preview_surface import shade_preview
from fabricusd.reference.scene import DISTANT, FabricSurface, Light, PreviewSurface, Scene
from fabricusd.schema import load
from tests.reference.scenes import above, grid, render_scene


def test_the_kernels_compiled_ahead_are_those_that_a_picture_calls():
    compile_shading()
    kernels = (shade_far, shade_preview, depart)
    before = [kernel.signatures for kernel in kernels]
    scene = Scene(
        meshes=[grid(), grid(material=1, size=2.0)],
        materials=[
            FabricSurface(binding=Binding(fabric=load("linen_plain"), metres_per_uv=1.0)),
            PreviewSurface(),
        ],
        lights=[Light(path="sun", kind=DISTANT, radiance=(1.0, 1.0, 1.0))],
        camera=above(width=4.0),
    )
    render_scene(scene, width=8, height=8, spp=1, level="far")
    assert [kernel.signatures for kernel in kernels] == before
