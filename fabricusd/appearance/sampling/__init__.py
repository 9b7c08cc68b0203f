"""What the samplers of both laws share: lobes, stretches of a curve, shares."""
