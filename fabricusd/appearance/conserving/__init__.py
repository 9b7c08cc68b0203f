"""The law of fabrics whose threads conserve energy."""
