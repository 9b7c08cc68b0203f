"""Bake the fabrics of a garment into textures and measure the error of the textures.

Called, it is `fabricusd.api.bake`: fabricusd.bake(scene, folder, ...).
"""

from fabricusd.callable_module import make_callable

make_callable(__name__)
