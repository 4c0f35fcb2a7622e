"""Find lines of text."""
