"""Characters: outlines and strokes, the fonts they come from, and serials made of them."""
