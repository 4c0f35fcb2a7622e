"""From moments back to maps: land, edge map, relief, friction, and the play between directions."""
