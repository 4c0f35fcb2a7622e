"""Wear of the metal itself: rubbing, peening and dents."""
