"""Estimate maps from moments: land, edge map, relief, friction, and stage play between directions."""
