"""One part to one reading."""
