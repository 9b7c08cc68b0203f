"""What a texel holds: layers, maps, encodings."""
