"""Pages and pictures of it."""
