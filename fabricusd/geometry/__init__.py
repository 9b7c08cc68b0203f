"""The repeat of a weave as tubes that light is traced through: what the levels are judged by."""

from fabricusd.geometry.cloth import Cloth, tubes
from fabricusd.geometry.paths import Reflectance, Shares, albedo, radiance_at, reflectance
from fabricusd.geometry.places import Seen, lit_share, seen

__all__ = [
    "Cloth",
    "Reflectance",
    "Seen",
    "Shares",
    "albedo",
    "lit_share",
    "radiance_at",
    "reflectance",
    "seen",
    "tubes",
]
