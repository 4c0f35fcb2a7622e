"""File formats in and out, and discovery of parts."""
