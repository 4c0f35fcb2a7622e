"""What is tried: designs, editions, and the parts they make."""
