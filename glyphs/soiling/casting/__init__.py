"""Casting: the rough skin of a green-sand casting, on which or in which the mark stands."""
