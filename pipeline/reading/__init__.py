"""Read one part."""
