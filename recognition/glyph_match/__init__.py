"""Match glyphs of a font with a view: templates predicted by physics, by correlation or as prototypes."""
