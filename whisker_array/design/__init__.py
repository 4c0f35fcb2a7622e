"""Design of whiskers: the search, the limits, and what they cost."""
