"""Learn a die: characters cut out of parts whose text is known, and the font that they make."""
