"""Tip and surface: one trace by either fidelity, pointwise or contact."""
