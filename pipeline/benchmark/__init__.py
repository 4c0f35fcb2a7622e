"""Accuracy on dirty parts, and its report."""
