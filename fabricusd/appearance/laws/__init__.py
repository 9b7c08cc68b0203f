"""The registry of surface laws of published threads: one module per law, named by
`fabric.SURFACE_LAWS`.

To add a law, write a module here that defines `LAW`, append its name to `fabric.SURFACE_LAWS`, and
run `make schema`. `facets` is the law of `conserving` threads, in `appearance.conserving`, whatever
the fabric names.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from fabricusd.appearance.laws.law import Law, same_gap
from fabricusd.fabric import FACETS, SURFACE_LAWS, Fabric
from fabricusd.kernels.choice import by_type

REGISTRY: dict[str, Law] = {
    name: import_module(f"{__name__}.{name}").LAW for name in SURFACE_LAWS if name != FACETS
}
_BY_TYPE = {law.tables: law for law in REGISTRY.values()}


def law_of(fabric: Fabric) -> Law:
    """The law of the published threads of `fabric`."""
    return REGISTRY.get(fabric.surface_law, REGISTRY[SURFACE_LAWS[0]])


def gaps_close(tables: Any) -> bool:
    """Whether less light passes the gaps from aside, under the law of these tables."""
    return _BY_TYPE[type(tables)].openness is not same_gap


def law_summary(name: str) -> str:
    """A phrase that says what a surface law is; name : one of `fabric.SURFACE_LAWS`."""
    if name == FACETS:
        return "threads as microfacets, the law of conserving threads"
    return REGISTRY[name].summary


def _part(name: str) -> Any:
    """A kernel (R, tables, ...) that selects one field of `Law` by the type of the tables."""
    return by_type(lambda tables: getattr(_BY_TYPE[tables], name))


shared, weight, mask, total = (_part(n) for n in ("shared", "weight", "mask", "total"))
hides, view_place = _part("hides"), _part("view_place")
visible_shares, view_shares = _part("visible_shares"), _part("view_shares")
openness, node_room = _part("openness"), _part("node_room")
light_nodes, lit_node, lit_alone = (_part(n) for n in ("light_nodes", "lit_node", "lit_alone"))
"""Each of these takes (R, tables, ...) as in `Law`."""
