"""Views: what a picture shows of the light that was rendered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.errors import FabricError
from fabricusd.images.view import View, aces, encode, neutral, parse_view, srgb
from fabricusd.srgb import srgb_encode

CURVES = {"neutral": neutral, "srgb": srgb, "aces": aces}
COLORS = st.tuples(*[st.floats(0, 1e4)] * 3).map(np.array)


@pytest.mark.parametrize("name", CURVES)
def test_middle_grey_stays_where_it_is(name: str) -> None:
    assert CURVES[name](np.full(3, 0.18)) == pytest.approx(0.18, abs=1e-9)
    code = encode(np.full((1, 3), 0.18), view=View(name=name))
    assert code.tolist() == [[118, 118, 118]]


@pytest.mark.parametrize("name", CURVES)
def test_a_brighter_grey_is_never_shown_darker_and_ends_at_white(name: str) -> None:
    x = np.geomspace(1e-4, 1e5, 2000)
    y = CURVES[name](np.stack([x] * 3, axis=-1))[:, 0]
    assert np.all(np.diff(y) >= -1e-12)
    assert y[-1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("name", ["neutral", "srgb"])
@given(color=st.tuples(*[st.floats(0, 0.8)] * 3).map(np.array))
def test_a_colour_below_the_compression_is_shown_as_it_is(name: str, color) -> None:
    assert np.array_equal(CURVES[name](color), color)


def test_dark_cloth_is_not_crushed() -> None:
    """0.02 is code 39 in sRGB; the ACES curve shows 19."""
    assert encode(np.full((1, 3), 0.02))[0, 0] == round(float(srgb_encode(0.02)) * 255) == 39
    assert encode(np.full((1, 3), 0.02), view=View(name="aces"))[0, 0] < 25


def test_neutral_is_what_khronos_published_without_the_reflection_of_a_dielectric() -> None:
    """The published lines in order, with F90 = 0, one colour at a time."""

    def published(color: np.ndarray) -> np.ndarray:
        start, desaturation = 0.8 - 0.0, 0.15
        peak = max(color)
        if peak < start:
            return color
        d = 1.0 - start
        new_peak = 1.0 - d * d / (peak + d - start)
        color = color * (new_peak / peak)
        g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0)
        return color * (1 - g) + new_peak * g

    colors = np.random.default_rng(3).exponential(1.0, (500, 3))
    assert neutral(colors) == pytest.approx(np.array([published(c) for c in colors]))


@given(COLORS)
def test_neutral_keeps_the_order_of_the_channels_and_stays_below_white(color) -> None:
    shown = neutral(color)
    assert shown.max() <= 1.0
    assert shown.min() >= 0.0
    order = np.argsort(color, kind="stable")
    assert np.all(np.diff(shown[order]) >= -1e-12)


def test_an_exposure_is_a_factor_before_the_view() -> None:
    light = np.array([[0.1, 0.2, 0.4]])
    assert encode(light, 1.0).tolist() == encode(2 * light).tolist()


def test_what_is_not_a_colour_is_black_or_white() -> None:
    pixel = np.array([[np.nan, np.inf, -1.0]])
    assert encode(pixel, view=View(name="srgb")).tolist() == [[0, 255, 0]]


@pytest.mark.parametrize("text", ["neutral", "srgb", "aces", " aces "])
def test_a_view_is_read_by_its_name(text: str) -> None:
    assert str(parse_view(text)) == text.strip()


DEFAULT = "ocio ocio://default"


def test_a_view_of_ocio_is_that_of_its_config() -> None:
    """`Un-tone-mapped` of the sRGB display is the sRGB view."""
    view = parse_view(f"{DEFAULT}:Un-tone-mapped")
    assert (view.config, view.view) == ("ocio://default", "Un-tone-mapped")
    light = np.random.default_rng(1).random((4, 5, 3))
    ours = encode(light, view=View(name="srgb")).astype(int)
    assert np.abs(encode(light, view=view).astype(int) - ours).max() <= 1
    assert str(view) == "ocio ocio://default:Un-tone-mapped"


def test_a_config_has_a_default_view_and_views_of_other_displays() -> None:
    light = np.full((1, 1, 3), 0.5)
    default = encode(light, view=parse_view(DEFAULT))
    assert default.tolist() != encode(light, view=View(name="srgb")).tolist()
    other = parse_view(f"{DEFAULT}:Gamma 2.2 Rec.709 - Display/Un-tone-mapped")
    assert encode(light, view=other)[0, 0, 0] == round(0.5 ** (1 / 2.2) * 255)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "it must be neutral, srgb, aces, or 'ocio CONFIG"),
        ("filmic", "is 'filmic'; it must be"),
        ("aces x", "is 'aces x'; it must be"),
        ("ocio", "is 'ocio'; it must be"),
        ("ocio /nowhere.ocio", "'/nowhere.ocio', which cannot be used"),
        (f"{DEFAULT}:Un-tone-maped", r"did you mean 'Un-tone-mapped'\?"),
    ],
)
def test_what_is_no_view_is_refused(text: str, said: str) -> None:
    with pytest.raises(FabricError, match=said) as refusal:
        parse_view(text)
    assert str(refusal.value).startswith("--view ")


def test_a_damaged_config_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "bad.ocio").write_text("nonsense: [\n")
    with pytest.raises(FabricError, match="which cannot be used") as refusal:
        parse_view(f"ocio {tmp_path / 'bad.ocio'}")
    assert "\n" not in str(refusal.value)
