"""Photographs of a part: the same surface lit and taken from above."""
