"""Those who say which character stands where."""
