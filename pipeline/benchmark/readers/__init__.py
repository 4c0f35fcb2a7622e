"""Readers: this program, other programs, and functions of the user."""
