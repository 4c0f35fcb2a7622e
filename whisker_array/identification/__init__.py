"""Identification of a whisker and its bench from a recording over a test piece."""
