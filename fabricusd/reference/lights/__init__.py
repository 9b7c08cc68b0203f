"""Lights: their table, how they are sampled, how rays meet them."""
