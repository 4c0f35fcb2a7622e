"""Find the lines of a part and read them."""
