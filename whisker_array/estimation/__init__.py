"""Estimate maps from moments: land, edge map, relief, friction, and the play between directions."""
