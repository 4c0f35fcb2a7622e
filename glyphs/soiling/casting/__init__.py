"""Casting: the rough skin of a green-sand casting with raised or sunk marks."""
