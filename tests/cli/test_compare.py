"""`fabricusd compare` on pictures with a layer `variance`."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fabricusd.cli.main import main
from fabricusd.images.files import write_exr

CHANNELS = {"beauty": ("R", "G", "B", "A"), "variance": ("R", "G", "B")}


def written(path, change=1.0, seed=0, variance=4e-4, layers=("beauty", "variance")):
    """A noisy picture of a ramp, `change` times as bright, as `render --aov variance` writes it."""
    ramp = np.broadcast_to(np.linspace(0.2, 1.0, 48), (32, 48))[..., None].repeat(3, 2)
    rgb = np.random.default_rng(seed).normal(change * ramp, np.sqrt(variance))
    data = {
        "beauty": np.concatenate([rgb, np.ones((32, 48, 1))], 2),
        "variance": np.full((32, 48, 3), variance),
    }
    write_exr(path, {k: data[k] for k in layers}, CHANNELS, {"fabricusd:seed": seed})
    return str(path)


@pytest.fixture
def reference(tmp_path):
    return written(tmp_path / "reference.exr")


def test_noise_explains_the_difference_of_two_renders_of_the_same(tmp_path, reference, capsys):
    again = written(tmp_path / "again.exr", seed=1)
    assert main(["compare", again, reference, "--significance", "0.001"]) == 0
    shown = capsys.readouterr()
    assert "noise may explain the difference" in shown.out
    assert shown.err == ""


def test_noise_does_not_explain_a_picture_three_per_cent_brighter(tmp_path, reference, capsys):
    brighter = written(tmp_path / "brighter.exr", change=1.03, seed=1)
    assert main(["compare", brighter, reference]) == 0
    assert "larger than the noise, most at pixel (" in capsys.readouterr().out
    assert main(["compare", brighter, reference, "--significance", "0.001"]) == 1


def test_the_test_is_part_of_the_json(tmp_path, reference, capsys):
    again = written(tmp_path / "again.exr", seed=1)
    assert main(["compare", again, reference, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["noise"]["larger"] is False
    assert found["noise"]["significance"] == 0.01
    assert 0.01 < found["noise"]["p"] <= 1
    assert found["rmse"] > 0


def test_without_variance_there_is_no_test(tmp_path, reference, capsys):
    bare = written(tmp_path / "bare.exr", seed=1, layers=("beauty",))
    assert main(["compare", bare, reference, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["noise"] is None
    assert main(["compare", bare, reference, "--significance", "0.01"]) == 2
    assert "--significance needs two EXRs with a layer 'variance'" in capsys.readouterr().err


def test_a_variance_of_zero_is_not_taken_for_certainty(tmp_path, reference, capsys):
    one_sample = written(tmp_path / "one.exr", seed=1, variance=0.0)
    assert main(["compare", one_sample, reference]) == 0
    shown = capsys.readouterr()
    assert "noise  " not in shown.out
    assert "one.exr: the layer 'variance' is 0 everywhere" in shown.err


def test_pictures_of_one_seed_are_noted(tmp_path, reference, capsys):
    assert main(["compare", reference, reference]) == 0
    assert "both pictures have the seed 0" in capsys.readouterr().err
    assert main(["compare", reference, reference, "-q"]) == 0
    assert capsys.readouterr().err == ""


def split(source, path):
    """The layers of an EXR as parts of one, as other renderers write them."""
    import OpenImageIO as oiio

    from fabricusd.images.files import read_exr_layers

    layers, _ = read_exr_layers(source)
    specs, planes = [], []
    for name, layer in layers.items():
        h, w, c = layer.shape
        spec = oiio.ImageSpec(w, h, c, oiio.FLOAT)
        spec.channelnames = tuple("RGBA"[:c])
        spec.attribute("oiio:subimagename", "rgba" if name == "beauty" else name)
        specs.append(spec)
        planes.append(layer)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), specs)
    for k, plane in enumerate(planes):
        if k:
            assert out.open(str(path), specs[k], "AppendSubimage")
        assert out.write_image(np.ascontiguousarray(plane, np.float32))
    out.close()
    return str(path)


def test_layers_in_parts_of_their_own_are_read_and_the_compared_part_is_named(tmp_path, capsys):
    first = split(written(tmp_path / "a.exr", seed=1), tmp_path / "parts_a.exr")
    second = split(written(tmp_path / "b.exr", change=1.03), tmp_path / "parts_b.exr")
    assert main(["compare", first, second, "--significance", "0.001"]) == 1
    shown = capsys.readouterr()
    assert "larger than the noise" in shown.out
    for name in (first, second):
        assert f"{name}: has 2 parts; the first, 'rgba', is compared" in shown.err
