"""Rust: lost steel, and the oxide that replaces it."""
