"""Measure the error of a bake, and find the cheapest bake that meets a bound."""
