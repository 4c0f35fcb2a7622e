"""Design of whiskers: search, limits and their cost."""
