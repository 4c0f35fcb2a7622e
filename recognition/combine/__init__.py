"""Posteriors of several looks and experts, combined."""
