"""Beside a weld: heat scale in plates, welded-on spatter, grinder swathes across the mark, arc strikes, heat
tint."""
