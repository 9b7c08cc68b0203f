"""The panels in the order of the page. To add one, write a module with a PANEL and add it here."""

from __future__ import annotations

from fabricusd.chart.panel import Panel
from fabricusd.chart.panels import (
    baked,
    fuzz,
    laws,
    materials,
    pictures,
    previews,
    reflectance,
    shadows,
    yarn,
    zoom,
)

PANELS: tuple[Panel, ...] = (
    reflectance.PANEL,
    laws.PANEL,
    pictures.PANEL,
    previews.PANEL,
    zoom.PANEL,
    shadows.PANEL,
    yarn.PANEL,
    fuzz.PANEL,
    *baked.PANELS,
    materials.PANEL,
)
