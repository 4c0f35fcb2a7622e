"""Where lines of text are."""
