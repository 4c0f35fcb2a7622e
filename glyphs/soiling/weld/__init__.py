"""Traces of a weld nearby: scale in plates, welded-on spatter, grinder swathes, arc strikes, heat tint."""
