"""Compute the bidirectional texture function of a fabric's repeat, in three compressed forms."""
