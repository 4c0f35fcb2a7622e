"""Marks of a text that was read: their poses, felt strokes, depths and grades."""
