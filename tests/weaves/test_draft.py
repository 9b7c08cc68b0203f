"""Drafts, and fabrics made of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, Thread, ThreadSet, Weave
from fabricusd.weaves import Draft, from_fabric, losses, to_fabric, with_colors
from fabricusd.weaves.convert import albedo_scale
from tests.draft_strategies import drafts
from tests.strategies import fabrics

PLAIN = Weave(np.eye(2, dtype=bool), "plain")
RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
STRIPES = Draft(weave=PLAIN, palette=(RED, BLUE), warp_colors=(0, 0, 1), weft_colors=(1,))


def top_colors(fabric: Fabric, ends: int, picks: int) -> np.ndarray:
    """(ends, picks, 3) colour of the thread on top, straight from the fabric's definition."""
    threads = fabric.thread_list
    out = np.zeros((ends, picks, 3))
    for i in range(ends):
        for j in range(picks):
            over = fabric.weave.cells[i % fabric.weave.ends, j % fabric.weave.picks]
            order = fabric.warp.sequence if over else fabric.weft.sequence
            out[i, j] = threads[order[(i if over else j) % len(order)]].color
    return out


def test_each_colour_in_use_becomes_one_thread() -> None:
    fabric = to_fabric(STRIPES, name="Stripes")
    assert list(fabric.threads) == ["Color1", "Color2"]
    assert fabric.name == "Stripes"
    assert fabric.warp.sequence == (0, 0, 1)
    assert fabric.weft.sequence == (1,)
    assert [t.color for t in fabric.thread_list] == [RED, BLUE]


def test_albedo_is_the_colour_times_the_base_threads_brightest_channel() -> None:
    linen = Thread(albedo=(0.06, 0.24, 0.3), ior=1.46, documentation="linen")
    assert albedo_scale(linen) == 0.3
    fabric = to_fabric(STRIPES, linen)
    assert fabric.threads["Color1"].albedo == (0.3, 0.0, 0.0)
    assert {t.ior for t in fabric.thread_list} == {1.46}


def test_a_draft_without_colours_is_woven_of_the_base_thread_itself() -> None:
    base = Thread(albedo=(0.1, 0.2, 0.3), color=(0.4, 0.5, 0.6))
    assert to_fabric(Draft(weave=PLAIN), base).threads == {"Thread": base}


def test_thicknesses_of_one_colour_become_threads_of_their_own() -> None:
    draft = replace(STRIPES, warp_colors=(0, 0), warp_thicknesses=(1e-3, 2e-3), weft_thickness=3e-3)
    fabric = to_fabric(draft, Thread(thickness=5e-3))
    assert {n: t.thickness for n, t in fabric.threads.items()} == {
        "Color1": 1e-3,
        "Color1_2": 2e-3,
        "Color2": 3e-3,
    }


def test_a_thickness_that_the_draft_does_not_know_is_the_base_threads() -> None:
    draft = replace(STRIPES, warp_colors=(0, 0), warp_thicknesses=(0.0, 2e-3))
    fabric = to_fabric(draft, Thread(thickness=5e-3))
    assert [t.thickness for t in fabric.thread_list] == [5e-3, 2e-3, 5e-3]


def test_density_is_one_over_the_spacing_and_its_mean_where_it_is_uneven() -> None:
    draft = Draft(weave=PLAIN, warp_spacings=(1e-3, 3e-3), weft_spacing=4e-3)
    fabric = to_fabric(draft)
    assert fabric.warp.density == pytest.approx(500)
    assert fabric.weft.density == pytest.approx(250)
    assert "warp is spaced unevenly, 1 to 3 mm" in losses(draft)[0]
    assert losses(draft)[0] in fabric.documentation


def test_unknown_spacing_takes_the_density_asked_for_and_says_so() -> None:
    assert to_fabric(Draft(weave=PLAIN), density=1234).warp.density == 1234
    assert to_fabric(Draft(weave=PLAIN)).warp.density == ThreadSet().density
    assert losses(Draft(weave=PLAIN)) == (
        "The draft has no density; 20 ends/cm and 20 picks/cm are assumed.",
    )


def test_a_fabric_says_where_its_draft_is_from() -> None:
    draft = replace(STRIPES, source="d.wif", author="A. Weaver", notes="Two lines\nof notes")
    text = to_fabric(draft).documentation
    assert text.startswith("Draft: d.wif. Author: A. Weaver. ")
    assert text.endswith("Two lines\nof notes")


def test_hidden_threads_are_left_out_of_the_cloth() -> None:
    weave = Weave(np.arange(12).reshape(3, 4) % 5 < 2, "three")
    draft = Draft(
        weave=weave,
        palette=(RED, BLUE),
        warp_colors=(0, 1, 0),
        weft_colors=(1,),
        warp_spacings=(1e-3, 0.0, 1e-3),
        warp_thicknesses=(1e-3, 2e-3, 3e-3),
    )
    fabric = to_fabric(draft)
    assert np.array_equal(fabric.weave.cells, weave.cells[[0, 2]])
    assert [fabric.thread_list[k].thickness for k in fabric.warp.sequence] == [1e-3, 3e-3]
    assert fabric.warp.density == pytest.approx(1000)
    assert "1 hidden warp thread(s)" in losses(draft)[0]


def test_hiding_threads_keeps_colours_that_repeat_with_another_length() -> None:
    draft = replace(STRIPES, warp_spacings=(0.0, 1e-3))
    # Ends 0 to 5 are coloured 0 0 1 0 0 1; the odd ones remain.
    fabric = to_fabric(draft)
    assert [fabric.thread_list[k].color for k in fabric.warp.sequence] == [RED, RED, BLUE]
    assert fabric.weave.cells.tolist() == [[False, True]] * 3


def test_a_set_that_is_hidden_altogether_is_refused() -> None:
    with pytest.raises(FabricError, match="spacing is 0 for every thread"):
        to_fabric(Draft(weave=PLAIN, weft_spacings=(0.0, 0.0)))


@given(drafts(colored=True))
def test_the_fabric_shows_the_colours_of_the_draft(draft: Draft) -> None:
    if any(0.0 in side.spacings for side in (draft.warp, draft.weft)):
        return
    m, n = draft.weave.cells.shape
    warp = np.array(draft.palette)[list(draft.warp_colors)][:, None]
    weft = np.array(draft.palette)[list(draft.weft_colors)][None, :]
    expected = np.where(draft.weave.cells[..., None], warp, weft)
    assert np.array_equal(top_colors(to_fabric(draft), m, n), expected)


@given(drafts(colored=True))
def test_a_draft_comes_back_from_its_fabric(draft: Draft) -> None:
    if any(0.0 in side.spacings for side in (draft.warp, draft.weft)):
        return
    back = from_fabric(to_fabric(draft))
    assert np.array_equal(back.weave.cells, draft.weave.cells)
    for old, new in ((draft.warp, back.warp), (draft.weft, back.weft)):
        assert [back.palette[k] for k in new.colors] == [draft.palette[k] for k in old.colors]
        known = [t or old.thickness or 0.0 for t in old.thicknesses or (0.0,) * old.threads]
        assert list(new.thicknesses or (new.thickness or 0.0,) * new.threads) == known
        pitch = np.mean(old.spacings) if old.spacings else old.spacing or ThreadSet().pitch
        assert new.spacing == pytest.approx(pitch, rel=1e-12)


@given(fabrics())
def test_every_fabric_has_a_draft_that_weaves_the_same_colours(fabric: Fabric) -> None:
    again = to_fabric(from_fabric(fabric))
    assert np.array_equal(top_colors(again, 24, 24), top_colors(fabric, 24, 24))


def test_a_density_that_no_draft_can_say_is_left_out() -> None:
    draft = from_fabric(Fabric(warp=ThreadSet(density=1e-3), weft=ThreadSet(density=1e9)))
    assert (draft.warp_spacing, draft.weft_spacing) == (None, None)


def test_with_colours_replaces_one_set_and_keeps_the_other() -> None:
    assert with_colors(STRIPES) is STRIPES
    green = (0.0, 1.0, 0.0)
    draft = with_colors(STRIPES, warp=[green])
    assert [draft.palette[k] for k in draft.warp_colors] == [green]
    assert [draft.palette[k] for k in draft.weft_colors] == [BLUE]


def test_with_colours_gives_both_sets_the_one_colour_named() -> None:
    draft = with_colors(Draft(weave=PLAIN), weft=[RED])
    assert (draft.palette, draft.warp_colors, draft.weft_colors) == ((RED,), (0,), (0,))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"warp_colors": (2,)}, "warp colour 0 is 2; it must be from 0 to 1"),
        ({"weft_colors": (0, -1)}, "weft colour 1 is -1; it must be from 0 to 1"),
        ({"palette": ()}, "colours number 0 in the palette, 3 in the warp and 1 in the weft"),
        ({"weft_colors": ()}, "give all three, or none"),
        ({"palette": ((0, 0, float("nan")), RED)}, "palette colour 0 is .*3 numbers"),
        ({"palette": ((0, 0), RED)}, "palette colour 0 is .*3 numbers"),
        ({"palette": (RED, (0, 0, -1))}, "palette colour 1 is .*at least 0"),
        ({"warp_spacing": -1e-3}, "warp spacing is -0.001 m; it must be from 1e-06 to 1 m"),
        ({"warp_spacing": float("nan")}, "warp spacing is nan m"),
        ({"weft_thickness": 0.0}, "weft thickness is 0.0 m"),
        ({"weft_thickness": float("inf")}, "weft thickness is inf m"),
        ({"warp_spacings": (1e-3,)}, "warp spacing has 1 numbers; it must have 2"),
        ({"weft_spacings": (1e-3, 2.0)}, "weft spacing 1 is 2.0 m; it must be 0, or"),
        ({"warp_thicknesses": (1e-3, -1.0)}, "warp thickness 1 is -1.0 m"),
    ],
)
def test_a_draft_that_cannot_be_is_refused_in_one_line(
    fields: dict[str, object], message: str
) -> None:
    with pytest.raises(FabricError, match=message) as caught:
        replace(STRIPES, **fields)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
