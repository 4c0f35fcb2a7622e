"""Who reads: this reader, other programs, and anybody's own."""
