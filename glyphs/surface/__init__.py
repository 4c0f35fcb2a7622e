"""Surfaces as height maps, and random fields for textures."""
