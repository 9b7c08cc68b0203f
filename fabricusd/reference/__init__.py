"""The reference path tracer: scene, acceleration structure, lights, cameras, film."""

from __future__ import annotations

from fabricusd.reference.film import AOVS
from fabricusd.reference.read import read_scene
from fabricusd.reference.render import RenderResult, render

__all__ = ["AOVS", "RenderResult", "read_scene", "render"]
