"""The recogniser: from a strip to posteriors of the places of a line."""
