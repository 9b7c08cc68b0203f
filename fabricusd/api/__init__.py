"""The commands as functions, for Python: `fabricusd.bake`, `material`, `preview` and `fit`.

Each imports what it needs when it is called. `fabricusd.render` is `reference.render` itself.
"""

from fabricusd.api.functions import bake, fit, material, preview

__all__ = ["bake", "fit", "material", "preview"]
