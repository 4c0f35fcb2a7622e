"""Training of the recogniser and the line finder."""
