"""Agreement studies: repeated readings, a page and tables."""
