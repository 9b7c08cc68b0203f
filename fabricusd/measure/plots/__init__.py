"""Plots of lobes, measured and fitted side by side."""
