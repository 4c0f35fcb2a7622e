"""Find and read the lines of a part, and look for other orientations and layouts."""
