"""Importance sampling for both surface laws: lobes, stretches of a curve, and lobe shares."""
