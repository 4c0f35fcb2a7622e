"""Meaning: predicted templates, localisation, matching and the reading of a serial."""
