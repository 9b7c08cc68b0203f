"""Rules that a stage is checked by."""
