"""Hypothesis strategies for drafts, as programs write them."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from fabricusd.fabric import Weave
from fabricusd.weaves import Draft
from fabricusd.weaves.color import palette_from_codes

LENGTHS = st.integers(1, 20000).map(lambda k: k * 1e-6)
LINES = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), max_size=12)


@st.composite
def drafts(draw: st.DrawFn, largest: int = 9, colored: bool | None = None) -> Draft:
    """A draft of up to `largest` threads each way; every part of it may be there or not."""
    m, n = draw(st.integers(1, largest)), draw(st.integers(1, largest))
    bits = draw(st.lists(st.booleans(), min_size=m * n, max_size=m * n))
    title = draw(LINES) or "draft"
    fields: dict[str, object] = {}
    if draw(st.booleans()) if colored is None else colored:
        high = draw(st.sampled_from((255, 999, 65535)))
        code = st.integers(0, high)
        codes = draw(st.lists(st.tuples(code, code, code), min_size=1, max_size=4, unique=True))
        fields["palette"] = palette_from_codes(codes, 0, high)
        fields["color_range"] = (0, high)
        index = st.integers(0, len(codes) - 1)
        fields["warp_colors"] = tuple(draw(st.lists(index, min_size=m, max_size=m)))
        fields["weft_colors"] = tuple(draw(st.lists(index, min_size=n, max_size=n)))
    for label, count in (("warp", m), ("weft", n)):
        for name, plural in (("spacing", "spacings"), ("thickness", "thicknesses")):
            fields[f"{label}_{name}"] = draw(st.none() | LENGTHS)
            # A reader gives a set one number where its threads are all alike.
            each = draw(st.lists(st.just(0.0) | LENGTHS, min_size=count, max_size=count))
            if draw(st.booleans()) and len(set(each)) > 1:
                fields[f"{label}_{plural}"] = tuple(each)
    return Draft(
        weave=Weave(np.array(bits).reshape(m, n), title),
        title=title,
        author=draw(LINES),
        notes="\n".join(draw(st.lists(LINES.filter(bool), max_size=3))),
        **fields,  # type: ignore[arg-type]
    )
