"""Inputs: trigger ports and the watched folder; HTTP is in `api`."""
