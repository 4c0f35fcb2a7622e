"""How well readings repeat: an agreement study, its page and its tables."""
