"""Every rule of a well-formed fabric, in the order in which findings are reported.

To add a rule: write a function in the module of what it looks at, decorate it, add a bad sample
named after its fault to `tests/schema/bad/`, run `make schema`. `fabricusd check`, `schema.read`
and USD's own validation framework (`fabricusd.schema.validators`) run this table. A rule sees one
prim and yields `(property name, problem)`; a problem reads on from the place: "is 0.8; it must be
at least 1".
"""

from __future__ import annotations

from fabricusd.schema.rules import common as _common  # isort: skip
from fabricusd.schema.rules import fabric as _fabric  # isort: skip
from fabricusd.schema.rules import thread as _thread  # isort: skip
from fabricusd.schema.rules import binding as _binding  # isort: skip
from fabricusd.schema.rules.table import RULES, Rule, applies, kinds, run

__all__ = ["MODULES", "RULES", "Rule", "applies", "kinds", "run"]

MODULES = (_common, _fabric, _thread, _binding)
"""What registers the rules; their order is that of the table."""
