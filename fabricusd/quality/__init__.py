"""Measures of how far apart two pictures or two colours are, and whether noise explains it."""
