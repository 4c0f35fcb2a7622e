"""Photographs of a part, lit and seen from above."""
