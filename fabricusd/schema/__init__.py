"""Fabrics as USD prims: schema, reading, writing, checking, presets, weave importers."""
