"""The sensor chain, whole scans, and their file format."""
