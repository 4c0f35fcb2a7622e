"""Find and read the lines of a view: each search in turn, until a line is convincing."""
