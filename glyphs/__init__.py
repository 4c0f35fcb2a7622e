"""What a mark is: height maps, character outlines, dies, stamping and the glyph database."""
