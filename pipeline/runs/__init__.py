"""Long runs: many parts into one table or store, taken up again after a break."""
