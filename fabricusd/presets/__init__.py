"""Cloth of the trade, derived from counts and densities: the presets of `schema/presets/trade`.

`rows.ROWS` has a row for each, `make.made` weaves it by what `fabricusd new` is made of, and
`python -m fabricusd.presets` writes the layers.
"""
