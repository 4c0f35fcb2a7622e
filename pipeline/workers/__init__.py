"""Executors: worker processes of this machine, and of a cluster."""
