"""Pages and pictures of a benchmark."""
