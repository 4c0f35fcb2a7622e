"""Surfaces as height maps, and the random fields that textures are made of."""
