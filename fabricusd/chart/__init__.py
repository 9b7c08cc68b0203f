"""Speed against accuracy: every method measured beside its rivals, and the choice made from that.

A panel is one function that measures, and a line in `registry.PANELS`. Everything is measured in
one process on one machine, in turns, so that ratios hold where absolute times do not.
"""
