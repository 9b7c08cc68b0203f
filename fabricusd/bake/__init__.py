"""Bake the fabrics of a garment into textures and measure the error of the textures."""
