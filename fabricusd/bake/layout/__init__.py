"""Where texels lie: garments, UVs, tiles, tangents."""
