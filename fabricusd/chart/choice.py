"""The method that a bound on the error asks for, from a table of measured fronts.

The table, `choice.json`, ships with the package: costs are of the machine it was made on, so only
their ratios count. `fabricusd chart --choice FILE` makes another. Cloth that is no preset is taken
to be as hard as the hardest one.
"""

from __future__ import annotations

import json
from pathlib import Path

from fabricusd.files import whole_file
from fabricusd.reference.choice import BOUNDS


def write_table(path: Path, quick: bool = True) -> None:
    """Measure every woven preset's shadowing methods and every preset's levels; write the table."""
    from fabricusd.appearance.shadow.methods import METHODS
    from fabricusd.chart.level_errors import coarsest
    from fabricusd.chart.panel import Row
    from fabricusd.chart.panels import shadows
    from fabricusd.schema import load, preset_names

    found: dict[str, dict[str, tuple[float, float]]] = {}
    rows: list[Row] = shadows.run(quick, shadows.WOVEN)
    for row in rows:
        if row.method in METHODS:
            cost, error = float(f"{row.cost:.3g}"), float(f"{row.error:.3g}")
            found.setdefault(row.group, {})[row.method] = (cost, error)
    # On pile every method gives 1.
    found["velvet"] = {m: (found[shadows.WOVEN[0]][m][0], 0.0) for m in METHODS}
    levels = {name: coarsest(load(name), BOUNDS) for name in preset_names()}
    text = json.dumps({"shadows": found, "levels": levels}, indent=1)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
