"""Cloth as a sum of tilted microfacet lobes, which every renderer has.

`mixture` says what such a sum is and evaluates it, `fit` finds the one that is nearest to a fabric,
`judge` says how near it is, and `known` keeps those of the presets.
"""
