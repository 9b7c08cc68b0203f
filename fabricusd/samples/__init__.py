"""A garment, a sky, artwork and drafts to try fabricusd with."""
