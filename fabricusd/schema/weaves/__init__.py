"""Weaves from a name, an expression, an image or a WIF draft."""
