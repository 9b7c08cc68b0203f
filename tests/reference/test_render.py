"""What `render` writes, refuses and survives."""

from __future__ import annotations

import sys
import threading

import numpy as np
import OpenEXR
import pytest
from pxr import Usd, UsdGeom

from fabricusd.errors import FabricError
from fabricusd.images.files import read_exr_layers, read_image
from fabricusd.reference.film import AOVS
from fabricusd.reference.render import render
from fabricusd.run import workers
from fabricusd.run.workers import Batches
from fabricusd.scene.scene import Scene
from fabricusd.schema import load
from fabricusd.srgb import srgb_decode, srgb_encode
from tests.reference.scenes import cloth, grid, lambert
from tests.reference.stages import new_stage, square


@pytest.fixture
def scene() -> Scene:
    return Scene(
        meshes=[grid(lambda x, z: 0.1 * np.sin(9 * x), cells=12)],
        materials=[cloth(load("linen_plain"))],
    )


def test_an_exr_holds_every_layer_and_all_settings(tmp_path, scene):
    out = tmp_path / "x.exr"
    r = render(scene, out, width=24, height=16, spp=4, aovs=tuple(AOVS), seed=11)
    layers, metadata = read_exr_layers(out)
    assert set(layers) == set(AOVS)
    for name, pixels in layers.items():
        assert pixels.shape == (16, 24, len(AOVS[name]))
        assert np.array_equal(pixels, r.layers[name])
    assert metadata["fabricusd:seed"] == 11
    assert metadata["fabricusd:samples"] == 4
    assert int(metadata["fabricusd:rays"]) == r.rays
    assert metadata.get("fabricusd:notes", "") == "\n".join(r.notes)
    assert r.paths == (str(out), str(tmp_path / "x.png"))


def test_other_readers_find_names_types_colours_and_where_a_picture_is_from(tmp_path):
    stage = new_stage(tmp_path)
    square(stage)
    stage.GetRootLayer().Save()
    out = tmp_path / "x.exr"
    render(tmp_path / "scene.usda", out, width=6, height=4, spp=1, aovs=("depth",), frames=(2.5,),
           exposure=1.5)  # fmt: skip
    [part] = OpenEXR.File(str(tmp_path / "x.02.5.exr"), separate_channels=True).parts
    names = {"R", "G", "B", "A", "depth.Z"}
    assert set(part.channels) == names
    assert {part.channels[name].pixels.dtype for name in names} == {np.dtype(np.float32)}
    assert part.header["chromaticities"] == pytest.approx(
        (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
    )
    assert part.header["dataWindow"][1].tolist() == [5, 3]
    assert part.header["fabricusd:scene"] == str(tmp_path / "scene.usda")
    assert part.header["fabricusd:timeCode"] == 2.5
    assert part.header["fabricusd:exposure"] == 1.5


def test_a_scene_without_light_or_camera_says_what_it_got(scene):
    r = render(scene, width=8, height=8, spp=1)
    assert [n for n in r.notes if "has no light; a sky and a key light are added" in n]
    assert [n for n in r.notes if "has no camera; one that sees all of it" in n]


def test_beauty_is_direct_plus_indirect(scene):
    r = render(scene, width=24, height=16, spp=4, aovs=("direct", "indirect"))
    total = r.layers["direct"] + r.layers["indirect"]
    assert np.abs(total - r.layers["beauty"][..., :3]).max() < 1e-5


def test_normals_have_length_one_where_cloth_is_and_depth_is_in_metres(scene):
    r = render(scene, width=24, height=16, spp=4, aovs=("normal", "depth", "thread", "uv"))
    met = r.layers["beauty"][..., 3] > 0
    assert met.any()
    assert not met.all()
    assert np.linalg.norm(r.layers["normal"], axis=2)[met] == pytest.approx(1.0, abs=1e-5)
    assert r.layers["depth"][met].min() > 0.1
    assert np.all(r.layers["thread"][~met] == -1)
    assert np.abs(r.layers["uv"]).max() <= 0.5 + 1e-6


def test_shadow_is_one_in_the_open_and_zero_behind_a_wall():
    from tests.reference.scenes import above, picture, sun

    roof = grid(size=0.4)
    roof = type(roof)(
        path="roof", points=roof.points + np.array([0, 0.5, 0]), triangles=roof.triangles,
        material=roof.material,
    )  # fmt: skip
    r = picture([grid(size=4.0), roof], [lambert(0.5)], [sun((1.0, 1.0, 0.0))],
                above(width=2.0), size=64, spp=4, aovs=("shadow",))  # fmt: skip
    assert r.layers["shadow"][32, 60, 0] == 1.0
    assert r.layers["shadow"][32, 16, 0] == 0.0


def test_a_png_alone_and_frames_with_numbers(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "s.usda"))
    mesh = UsdGeom.Mesh.Define(stage, "/m")
    mesh.CreatePointsAttr([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 3, 2, 1])
    op = mesh.AddTranslateOp()
    op.Set((0, 0, 0), 1)
    op.Set((0.8, 0, 0), 2)
    camera = UsdGeom.Camera.Define(stage, "/c")
    camera.AddTranslateOp().Set((0, 0.5, 6))
    stage.GetRootLayer().Save()
    r = render(tmp_path / "s.usda", tmp_path / "x.png", frames=(1, 2), width=32, height=16, spp=2)
    assert [p.rsplit("/", 1)[1] for p in r.paths] == ["x.0001.png", "x.0002.png"]
    first, second = (read_image(p) for p in r.paths)
    assert not np.array_equal(first, second)


def test_what_one_of_several_frames_lacks_is_told_of_all(tmp_path):
    stage = new_stage(tmp_path)
    mesh = square(stage)
    mesh.GetPointsAttr().Set([(np.nan, 0, 0), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], 1)
    mesh.GetPointsAttr().Set([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], 2)
    stage.GetRootLayer().Save()
    one = render(tmp_path / "scene.usda", width=8, height=8, spp=1, frames=(2,))
    both = render(tmp_path / "scene.usda", width=8, height=8, spp=1, frames=(1, 2))
    assert any("points that are not finite" in note for note in both.notes)
    assert len(both.notes) > len(one.notes)
    assert both.rays > one.rays
    assert both.complete
    assert np.array_equal(both.layers["beauty"], one.layers["beauty"])


def test_progress_is_that_of_all_frames_and_never_falls(tmp_path):
    stage = new_stage(tmp_path)
    square(stage)
    stage.GetRootLayer().Save()
    told: list[tuple[float, float]] = []
    render(
        tmp_path / "scene.usda", width=8, height=8, spp=1, frames=(1, 2, 3, 4),
        progress=lambda share, seconds: told.append((share, seconds)),
    )  # fmt: skip
    shares, seconds = zip(*told, strict=True)
    assert list(shares) == sorted(shares)
    assert list(seconds) == sorted(seconds)
    assert shares[0] <= 0.25
    assert shares[-1] == pytest.approx(1.0)


BAD_SETTINGS = {
    "no width": ({"width": 0}, "width is 0"),
    "no samples": ({"spp": 0}, "spp is 0"),
    "negative noise": ({"noise": -1.0}, "noise is -1;"),
    "an unknown layer": ({"aovs": ("beuaty",)}, "aov is 'beuaty'"),
    "an unknown level": ({"level": "near"}, "level is 'near'"),
    "an unknown shadow": ({"shadow": "soft"}, "shadow is 'soft'"),
    "an unknown filter": ({"pixel_filter": "sinc"}, "pixel filter is 'sinc'"),
    "no worker": ({"workers": 0}, "workers is 0"),
    "negative bounces": ({"max_bounces": -1}, "max_bounces is -1"),
}


@pytest.mark.parametrize("name", BAD_SETTINGS)
def test_a_setting_that_makes_no_sense_is_refused_with_its_value(scene, name):
    settings, words = BAD_SETTINGS[name]
    with pytest.raises(FabricError, match=words):
        render(scene, **{"width": 8, "height": 8, "spp": 1, **settings})


def test_an_output_that_cannot_be_written_is_refused_before_the_work(tmp_path, scene, monkeypatch):
    module = sys.modules[render.__module__]  # as an attribute, its package has the function
    monkeypatch.setattr(module, "render_scene", lambda *_, **__: pytest.fail("work was begun"))
    for name, words in (("no/such/x.exr", "not a directory"), ("x.jpeg2", "picture format")):
        with pytest.raises(FabricError, match=words):
            render(scene, tmp_path / name, width=8, height=8, spp=1)


def test_a_scene_without_triangles_shows_its_lights_and_says_so():
    r = render(Scene(), width=8, height=8, spp=1)
    assert any("no triangles" in n for n in r.notes)
    assert r.layers["beauty"][..., :3].min() > 0
    assert r.layers["beauty"][..., 3].max() == 0


def test_an_interrupt_keeps_what_is_done(tmp_path, scene, monkeypatch):
    real = workers.threading.Thread.join
    calls = []

    def join(self, timeout=None):
        # Threads that load or compile kernels are waited for without a limit of time.
        calls.extend([timeout] if timeout is not None else [])
        if len(calls) == 3:
            raise KeyboardInterrupt
        real(self, timeout)

    monkeypatch.setattr(workers.threading.Thread, "join", join)
    out = tmp_path / "x.exr"
    r = render(scene, out, width=128, height=128, spp=4096, aovs=("samples",))
    monkeypatch.undo()
    assert not r.complete
    assert 0 < r.samples < 4096
    layers, metadata = read_exr_layers(out)
    assert metadata["fabricusd:complete"] == 0
    assert np.isfinite(layers["beauty"]).all()
    assert list(tmp_path.glob(".*")) == []


def test_every_batch_is_done_once_whatever_the_number_of_workers():
    done, lock = [], threading.Lock()

    def task(worker, batch):
        with lock:
            done.append(batch)

    assert Batches(3, task).run(50)
    assert sorted(done) == list(range(50))


def test_an_error_in_a_worker_is_raised_where_the_work_was_asked_for():
    def task(worker, batch):
        if batch == 3:
            raise FabricError("batch", "is bad")

    with pytest.raises(FabricError, match="batch is bad"):
        Batches(2, task).run(10)


def test_srgb_decodes_what_it_encodes():
    x = np.linspace(0, 1, 1001)
    assert np.abs(srgb_decode(srgb_encode(x)) - x).max() < 1e-6
