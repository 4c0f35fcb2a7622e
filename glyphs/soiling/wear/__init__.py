"""Wear and knocks of the metal itself: rubbed, peened, dented."""
