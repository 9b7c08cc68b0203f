"""The reference path tracer: scene, acceleration structure, lights, cameras, film."""

from __future__ import annotations

from fabricusd.reference.film import AOVS
from fabricusd.reference.render import RenderResult, render
from fabricusd.scene.read import read_scene

__all__ = ["AOVS", "RenderResult", "read_scene", "render"]
