"""Rust: steel lost, and oxide standing in its place."""
