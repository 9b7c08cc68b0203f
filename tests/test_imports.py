"""The package's modules import one another without a circle, imports within functions included."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def circles(imports: dict[str, set[str]]) -> list[list[str]]:
    """The groups of modules of which each leads to each other."""
    names = sorted(imports)
    number = {name: k for k, name in enumerate(names)}
    pairs = [(number[a], number[b]) for a in names for b in imports[a]]
    rows, columns = np.array(pairs, int).reshape(-1, 2).T
    size = (len(names), len(names))
    graph = coo_array((np.ones(len(pairs)), (rows, columns)), shape=size)
    count, group = connected_components(graph, directed=True, connection="strong")
    found = ([names[k] for k in np.flatnonzero(group == g)] for g in range(count))
    return [each for each in found if len(each) > 1]


def test_no_module_leads_back_to_itself():
    grimp = pytest.importorskip("grimp")
    graph = grimp.build_graph("fabricusd", cache_dir=None)
    imports = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    assert len(imports) > 100
    assert circles(imports) == []


def test_a_circle_would_be_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]
    assert circles({"a": {"b"}, "b": set()}) == []
