"""Statistics of trials: shares, factors, pairs, bounds."""
