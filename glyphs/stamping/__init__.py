"""Dies and what they cut: faces, plates, blows, whole serials, and the database of glyphs."""
