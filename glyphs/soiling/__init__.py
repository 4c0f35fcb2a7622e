"""Dirt and damage of a part: deposits, their softness, and wear."""
