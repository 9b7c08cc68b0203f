"""Bidirectional texture functions of a fabric's repeat, in three compressed forms."""
