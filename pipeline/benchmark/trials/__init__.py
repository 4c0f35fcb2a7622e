"""Run of a benchmark, its journal, and answers of other programs."""
