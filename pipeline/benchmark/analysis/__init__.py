"""What the trials say: shares, factors, pairs, bounds."""
