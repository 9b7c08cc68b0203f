"""Measuring the table from which `render --max-error` chooses its methods.

The table ships with the package. Its costs are those of the machine that it was made on, so only
their ratios matter. `fabricusd chart --choice FILE` makes another one. Cloth that is not a preset
is taken to be as hard as the hardest preset.
"""

from __future__ import annotations

import json
from pathlib import Path

from fabricusd.fabric import even
from fabricusd.files import whole_file
from fabricusd.reference.choice import BOUNDS


def write_table(path: Path, quick: bool = True) -> None:
    """Measure the shadowing methods on every woven preset and the levels on every preset."""
    from fabricusd.appearance.shadow.kinds import METHODS
    from fabricusd.chart.level_errors import coarsest
    from fabricusd.chart.panel import Row
    from fabricusd.chart.panels import shadows
    from fabricusd.schema import load, published_names

    found: dict[str, dict[str, tuple[float, float]]] = {}
    rows: list[Row] = shadows.run(quick, shadows.WOVEN)
    for row in rows:
        if row.method in METHODS:
            cost, error = float(f"{row.cost:.3g}"), float(f"{row.error:.3g}")
            found.setdefault(row.group, {})[row.method] = (cost, error)
    # On pile, every method returns 1.
    found["velvet"] = {m: (found[shadows.WOVEN[0]][m][0], 0.0) for m in METHODS}
    levels = {name: coarsest(even(load(name)), BOUNDS) for name in published_names()}
    text = json.dumps({"shadows": found, "levels": levels}, indent=1)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
