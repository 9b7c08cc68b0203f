"""Materials of other renderers fitted to a fabric."""
