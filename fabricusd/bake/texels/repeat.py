"""The repeat of what is baked of a fabric: of its front, and of its back if that is baked too."""

from __future__ import annotations

import math

from fabricusd.appearance.scattering.models import translucent
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.fabric import Fabric


def baked_repeat(fabric: Fabric) -> tuple[int, int]:
    """Numbers of ends and picks after which the moments of texels repeat.

    A back that is a fabric of its own may repeat after other numbers than the front: the satin's
    after 3, its front after 5.
    """
    front = true_repeat(fabric)
    if fabric.back is None or not translucent(fabric):
        return front
    back = true_repeat(fabric.back)
    return math.lcm(front[0], back[0]), math.lcm(front[1], back[1])
