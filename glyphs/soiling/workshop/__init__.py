"""A metal workshop's dirt: grime, oil, swarf, scratches, pits, paint, burr."""
