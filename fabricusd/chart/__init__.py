"""Charts of speed against accuracy: every method is measured beside its rivals.

A panel is a function that measures, and a line in `registry.PANELS`. Everything is measured in one
process on one machine, in turns, so that ratios hold even where absolute times do not.
"""
