"""The interface of a surface law: what each module of `laws` provides.

Every law of published threads has the form

    L_o = sum a weight f_s mask cos(theta_i) g / total(sum a weight)

per unit `L_i dwi`, with the sum over the pieces of thread that the repeat shows, `a` their shares
of the cloth, and `g` the share of the light that neighbouring threads let through. `weight` says
how much of the view a piece takes. Level `far` is the sum, `weave` and `thread` are one term of it.
A law's tables have a class of their own, and kernels are compiled for it: those of one law contain
no code for the others. Source: `docs/model.md` section 4.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE

Kernel = Any
"""A scalar numba function, compiled in place (`real.INLINE`): (R, tables, ...), law the tables."""


COMMON = ("threads", "nodes", "node_thread", "published", "warp_start", "gap")
"""Fields of the tables of every law, see `tables.SurfaceTables`."""


VIEW_SHARES = 8
"""Numbers that say which places of both sets a view sees, see `Law.view_shares`."""


def tables_class(module: str, name: str, *own: str) -> Any:
    """A NamedTuple class with the fields COMMON and `own`.

    A law's own fields are not in a tuple of their own, because numba's parallel loops take no tuple
    of tuples.
    """
    return namedtuple(name, (*COMMON, *own), module=module)


@dataclass(frozen=True, kw_only=True)
class Law:
    """A surface law of published threads.

    summary : a phrase for the documentation of the schema
    tables : the class of its tables, see `tables_class`
    make : (fabric, nodes, means as `lit.light_fields` takes them, precision) -> the fields that are
        its own; nodes : `quadrature.CurveNodes`, None where no light is held back
    absolute : whether light that neighbouring threads hold back is lost. Otherwise the mask already
        contains the mean shadow, and `g` only says where in the repeat it falls
    shared : (R, tables, thread_set, across_o, cos_half) -> a number that `weight` may need, which
        is the same for all threads of a set; across_o : wo's component across the set; cos_half :
        cos(d/2), d the difference of the longitudes of wi and wo
    hides : (R, tables) -> a constant: whether `weight` reads what `visible_shares` returns
    view_place : (R, tables, ox, oy, oz) -> (entry, c, r), where the table of shares has a view
    visible_shares : (R, tables, thread_set, entry, c, r) -> four coefficients of the share of the
        places of a set that are seen, see `laws.visible`
    view_shares : (R, tables, entry, c, r, out, first) fills VIEW_SHARES entries of `out`, from
        `first` on, with the coefficients of weft and warp
    weight : (R, tables, c, s, pair) -> the weight of thread at the tangent angle with cosine c and
        sine s; pair : a `segment.SetPair`
    mask : (R, tables, cos_phi_i, cos_phi_o, cos_half) -> the factor of `f_s`, from azimuths
    total : (R, tables, seen, ox, oy, oz) -> the divisor; seen : sum of a weight
    openness : (R, tables, ox, oy, oz) -> the share of a view that passes between the threads
    node_room : (R, tables, size) -> entries that `light_nodes` fills for `size` lights
    light_nodes : (R, tables, x, y, z, lit, first) fills `lit` from `first` on, for one light
    lit_node : (R, tables, lit, first, node) -> mean of g at a node, from what that filled in
    lit_alone : (R, tables, node, x, y, z) -> mean of g at one node
    plain_weight, plain_mask, plain_total : the same in plain NumPy, sharing no code with the
        kernels: (fabric, is_warp, psi0, angles of wi, angles of wo), (fabric, angles, angles)
        and (fabric, seen, gap, wo)
    """

    summary: str
    tables: type
    make: Callable[[Fabric, Any, Any, Any], dict[str, Any]]
    absolute: bool
    shared: Kernel
    hides: Kernel
    view_place: Kernel
    visible_shares: Kernel
    view_shares: Kernel
    weight: Kernel
    mask: Kernel
    total: Kernel
    openness: Kernel
    node_room: Kernel
    light_nodes: Kernel
    lit_node: Kernel
    lit_alone: Kernel
    plain_weight: Callable[..., Any]
    plain_mask: Callable[..., Any]
    plain_total: Callable[..., Any]


@njit(**INLINE)
def nothing_shared(R, tables, thread_set, across_o, cos_half):
    """`Law.shared` of a law that needs none."""
    return R(0)


@njit(**INLINE)
def yes(R, tables):
    """`Law.hides` of a law whose threads hide one another."""
    return True


@njit(**INLINE)
def no(R, tables):
    """`Law.hides` of a law whose threads do not."""
    return False


@njit(**INLINE)
def no_place(R, tables, ox, oy, oz):
    """`Law.view_place` of a law whose threads do not hide one another."""
    return np.int32(0), R(0), R(0)


@njit(**INLINE)
def all_visible(R, tables, thread_set, entry, c, r):
    """`Law.visible_shares` of a law whose threads do not hide one another."""
    return R(1), R(0), R(0), R(0)


@njit(**INLINE)
def no_shares(R, tables, entry, c, r, out, first):
    """`Law.view_shares` of a law whose threads do not hide one another."""


@njit(**INLINE)
def no_mask(R, tables, cos_phi_i, cos_phi_o, cos_half):
    """`Law.mask` of a law without one."""
    return R(1)


@njit(**INLINE)
def same_gap(R, tables, ox, oy, oz):
    """`Law.openness` of cloth whose gaps are as wide from everywhere."""
    return tables.gap


@njit(**INLINE)
def no_room(R, tables, size):
    """`Law.node_room` of a law without a mean shadow."""
    return 1


@njit(**INLINE)
def no_nodes(R, tables, x, y, z, lit, first):
    """`Law.light_nodes` of a law without a mean shadow."""


@njit(**INLINE)
def always_lit(R, tables, lit, first, node):
    """`Law.lit_node` of a law without a mean shadow."""
    return R(1)


@njit(**INLINE)
def lit_alone(R, tables, node, x, y, z):
    """`Law.lit_alone` of a law without a mean shadow."""
    return R(1)
