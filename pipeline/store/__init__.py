"""What is kept: parts, readings, reviews, evidence and tokens, in SQLite or PostgreSQL."""
