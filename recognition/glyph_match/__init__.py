"""Glyphs of a font against what was felt or seen: templates that physics predicts, correlated or as prototypes."""
