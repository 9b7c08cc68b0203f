"""From photographs to lobes: response, exposures merged, white reference, one value per view."""
