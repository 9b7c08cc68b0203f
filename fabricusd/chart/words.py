"""Numbers as the pages of the charts write them."""

from __future__ import annotations


def number(x: float) -> str:
    """Two significant digits, without an exponent for numbers of moderate size."""
    return (
        "0"
        if x == 0
        else f"{x:.2g}"
        if 1e-3 <= abs(x) < 100
        else f"{x:.0f}"
        if x >= 100
        else f"{x:.1e}"
    )
