"""Formats and check digits, and decoding posteriors under them."""
