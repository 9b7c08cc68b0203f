"""The surface law of cloth whose threads conserve energy."""
