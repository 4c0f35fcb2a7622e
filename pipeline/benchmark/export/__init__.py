"""The exam as files, for whoever reads it elsewhere."""
