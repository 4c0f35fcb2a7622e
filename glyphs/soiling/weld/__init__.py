"""Beside a weld: heat scale in plates, spatter welded on, grinder swathes across the mark, arc strikes, heat tint."""
