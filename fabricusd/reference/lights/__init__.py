"""Lights: their table, sampling directions to them, and finding the lights that rays pass."""
