"""Pictures of cloth at once: one key light and a sky, no bounces; see docs/preview.md.

Called, it is `fabricusd.api.preview`: fabricusd.preview(fabric, ...).
"""

from fabricusd.callable_module import make_callable

make_callable(__name__)
