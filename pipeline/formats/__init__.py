"""File formats in and out, and which parts there are."""
