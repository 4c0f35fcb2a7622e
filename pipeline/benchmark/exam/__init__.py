"""Designs, editions, and the parts they make."""
