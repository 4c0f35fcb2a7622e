"""Which whisker to build: the search, the limits, and what they cost."""
