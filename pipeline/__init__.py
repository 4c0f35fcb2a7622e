"""Composition and the outside world: files, settings, batch runs and the command line."""
