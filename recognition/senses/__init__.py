"""Readers by one sense: touch, camera."""
