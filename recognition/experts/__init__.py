"""The recogniser: from a strip to posteriors of characters."""
