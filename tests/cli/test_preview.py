"""`fabricusd preview` as a person types it."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys

import numpy as np
import OpenImageIO as oiio
import pytest

from fabricusd.cli import preview as command
from fabricusd.preview.serve import traced
from fabricusd.preview.shapes import SHAPES
from tests.cli.commands import run
from tests.preview.page_arrays import decoded


def size_of(path) -> tuple[int, int]:
    spec = oiio.ImageBuf(str(path)).spec()
    return spec.width, spec.height


def test_every_shape_can_be_asked_for():
    assert set(command.SHAPES) == {*SHAPES, "scene"}


def test_a_picture_is_written_and_said(capsys, tmp_path):
    out = tmp_path / "a.png"
    status, printed, err = run(capsys, "preview", "linen_plain", "--size", "32", "-o", str(out))
    assert (status, printed) == (0, "")
    assert re.fullmatch(
        rf"fabricusd: {out}: linen_plain on a cylinder, 32 x 32 pixels in \S+ s\n", err
    )
    assert size_of(out) == (32, 32)


def test_without_a_terminal_the_picture_goes_to_a_file_that_is_named(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, _, err = run(capsys, "preview", "linen_plain{appearance=published}", "--size", "16")
    assert "linen_plain.png" in err
    assert size_of(tmp_path / "linen_plain.png") == (16, 16)


def test_a_mesh_wears_the_fabric(capsys, tmp_path):
    mesh = tmp_path / "square.obj"
    mesh.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "f 1/1 2/2 3/3 4/4\n"
    )  # fmt: skip
    out = tmp_path / "a.png"
    status, _, err = run(
        capsys, "preview", str(mesh), "--fabric", "linen_plain", "--size", "32", "-o", str(out)
    )
    assert status == 0, err
    assert size_of(out) == (32, 18)
    codes = oiio.ImageBuf(str(out)).get_pixels(oiio.UINT8)
    # Linen is teal: its middle is not grey.
    assert np.ptp(codes[9, 16].astype(int)) > 20


@pytest.fixture
def garment(capsys, tmp_path):
    """A USD scene: a square that wears linen, in a studio."""
    mesh, scene = tmp_path / "square.obj", tmp_path / "garment.usda"
    mesh.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "f 1/1 2/2 3/3 4/4\n"
    )  # fmt: skip
    status, _, err = run(
        capsys, "dress", str(mesh), "--fabric", "linen_plain", "-o", str(scene), "--units", "m"
    )
    assert status == 0, err
    return scene


def test_a_scene_is_seen_by_its_camera(capsys, garment, tmp_path):
    out = tmp_path / "a.png"
    status, _, err = run(capsys, "preview", str(garment), "--size", "48", "-o", str(out))
    assert status == 0, err
    assert "garment on a scene, 48 x 27 pixels" in err
    codes = oiio.ImageBuf(str(out)).get_pixels(oiio.UINT8).astype(int)
    # Teal cloth before a grey backdrop.
    assert np.ptp(codes[13, 24]) > 20
    assert np.ptp(codes[2, 2]) < 12


def test_a_page_of_a_scene_has_its_mesh(capsys, garment, tmp_path):
    out = tmp_path / "a.html"
    status, _, err = run(capsys, "preview", str(garment), "--page", str(out))
    assert status == 0, err
    assert '"meshes":{"scene":' in out.read_text()


def test_a_fabric_file_is_shown_on_a_shape(capsys, tmp_path):
    layer, out = tmp_path / "mine.usda", tmp_path / "a.png"
    run(capsys, "new", "--weave", "twill 2/2", "-o", str(layer))
    status, _, err = run(capsys, "preview", str(layer), "--size", "16", "-o", str(out))
    assert status == 0, err
    assert "mine on a cylinder" in err


def test_a_page_without_cloth_is_refused(capsys, tmp_path):
    mesh = tmp_path / "bare.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")
    out = tmp_path / "a.html"
    status, _, err = run(capsys, "preview", str(mesh), "--units", "m", "--page", str(out))
    assert status == 2
    assert "has no mesh that wears a fabric; name one with --fabric" in err
    assert not out.exists()


def test_a_sheet_is_a_picture_and_a_page(capsys, tmp_path):
    out = tmp_path / "sheet.png"
    status, _, _ = run(
        capsys, "preview", "--sheet", "linen_plain", "denim", "--size", "32", "-o", str(out)
    )
    assert status == 0
    assert size_of(out)[0] > 64
    page = (tmp_path / "sheet.html").read_text()
    assert page.count("<img") == 2
    assert "denim: twill 3/1 Z" in page
    assert not re.search(r"(src|href)=\"(?!data:)", page)


def test_variants_are_listed_on_a_sheet(capsys, tmp_path):
    out = tmp_path / "v.png"
    status, _, _ = run(
        capsys, "preview", "--variants", "linen_plain", "--size", "16", "-o", str(out)
    )
    assert status == 0
    page = (tmp_path / "v.html").read_text()
    for variant in ("nearest", "published", "conserving"):
        assert f"linen_plain{{appearance={variant}}}" in page


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "SOURCE is missing; give one, or several with --sheet"),
        (("denim", "velvet"), "SOURCE is 2 names; give one"),
        (("denim", "-o", "a.jpg"), "a.jpg is not a name for the picture; it must end in .png"),
        (("denim", "--light", "0", "91"), "--light ELEVATION is 91; it must be from -90 to 90"),
        (("denim", "--light", "nan", "0"), "--light AZIMUTH is nan; it must be from -360 to 360"),
        (("denim", "--presets"), "--presets takes no SOURCE, but 'denim' is given"),
        (("--sheet",), "SOURCE is missing; name the fabrics of the sheet"),
        (("--sheet", "denim", "--shape", "scene"), "--shape scene cannot be on a sheet"),
        (("velvt", "-o", "a.png"), "(did you mean 'velvet'?)"),
        (("denim", "--shape", "cylindr"), "(did you mean 'cylinder'?)"),
        (("denim", "--view", "filmic"), "--view is 'filmic'"),
        (("denim", "--page", "a.htm"), "a.htm is not a name for the page; it must end in .html"),
        (("denim", "--page", "a.html", "-o", "a.png"), "-o names a picture, 'a.png'"),
        (("denim", "--page", "a.html", "--sheet"), "--page shows one SOURCE"),
        (("denim", "--scheduler", "local"), "--scheduler draws the tiles of a sheet"),
        (("denim", "--sheet", "--scheduler", "local:x"), "--scheduler 'local:x' does not answer"),
    ],
)
def test_slips_are_refused_in_one_line(arguments, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, _, err = run(capsys, "preview", *arguments)
    assert status == 2
    assert said in err
    assert len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a", "--serve", "-o", "b.png"], "give it without --serve"),
        (["a", "--serve", "--page", "b.html"], "it must stand without --serve"),
        (["--presets", "--serve"], "--serve shows one SOURCE"),
        (["a", "--save", "b.usda"], "--save needs --serve"),
        (["a", "--port", "80"], "--port needs --serve"),
        (["a", "--reference"], "--reference needs --page"),
        (["denim", "--serve", "--save", "b.txt"], "b.txt is no name to save to"),
        (["denim", "--serve", "--port", "70000"], "--port: is '70000'; it must be a whole"),
        (["nothing", "--serve"], "nothing is neither a file nor a preset"),
    ],
)  # fmt: skip
def test_slips_of_a_server_are_refused_in_one_line(arguments, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, printed, err = run(capsys, "preview", *arguments)
    assert (status, printed) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_port_that_is_taken_is_said(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        status, _, err = run(capsys, "preview", "linen_plain", "--serve", "--port", str(port))
    assert status == 2
    assert f"--port is {port}, which cannot be used" in err


def hear_ctrl_c():
    """As in a terminal: what a shell starts in the background ignores it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
def test_a_server_is_stopped_by_ctrl_c():
    command = [sys.executable, "-m", "fabricusd", "preview", "linen_plain", "--serve"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=hear_ctrl_c,
    ) as one:  # fmt: skip
        url = one.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/#token=[\w-]{43}", url)
        port = int(url.split(":")[2].partition("/")[0])
        socket.create_connection(("127.0.0.1", port)).close()
        one.send_signal(signal.SIGINT)
        try:
            _, err = one.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            one.kill()
            raise
    assert one.returncode == 130
    assert err.splitlines()[-1] == "fabricusd: interrupted"
    assert "Traceback" not in err


@pytest.mark.slow
def test_a_page_has_the_reference_that_is_asked_for(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(traced, "FIRST", (16, 1))
    out = tmp_path / "a.html"
    assert run(capsys, "preview", "linen_plain", "--page", str(out), "--reference")[0] == 0
    held = json.loads(re.search(r'id="data">(.*?)</script>', out.read_text(), re.S)[1])
    reference = held["reference"]
    assert (reference["size"], reference["samples"], reference["level"]) == (16, 1, "far")
    assert decoded(reference["pixels"]).reshape(16, 16, 4)[8, 8, 3] == 1.0


def test_no_clobber_keeps_what_is_there(capsys, tmp_path):
    out = tmp_path / "a.png"
    out.write_bytes(b"mine")
    status, _, err = run(capsys, "preview", "denim", "-o", str(out), "--no-clobber")
    assert status == 2
    assert "exists" in err
    assert out.read_bytes() == b"mine"
