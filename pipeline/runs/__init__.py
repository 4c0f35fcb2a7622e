"""Long runs: many parts into one table or store, resumable after an interruption."""
