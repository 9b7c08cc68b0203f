"""The panels in the order of the page. To add one, write a module with a PANEL and add it here."""

from __future__ import annotations

from fabricusd.chart.panel import Panel
from fabricusd.chart.panels import baked, materials, pictures, reflectance, shadows, zoom

PANELS: tuple[Panel, ...] = (
    reflectance.PANEL,
    pictures.PANEL,
    zoom.PANEL,
    shadows.PANEL,
    *baked.PANELS,
    materials.PANEL,
)
