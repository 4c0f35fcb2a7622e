"""Storage of parts, readings, reviews, evidence and tokens, in SQLite or PostgreSQL."""
