"""WIF drafts: their syntax, reading and writing."""
